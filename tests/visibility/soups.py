"""Scenes of loose polygons, made by hypothesis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from solver import tolerances
from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.types import FloatArray, Points
from solver.visibility.rays import RayScene

GREY = Material(np.full(3, 0.5), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Soup:
    """A scene, and where it is."""

    surfaces: Surfaces
    rays: RayScene

    @property
    def tolerance(self) -> float:
        """Metres by which rays may round: four times their own offset."""
        return 4.0 * tolerances.RAY_OFFSET * self.surfaces.size

    def polygon(self, patch: int) -> Points:
        """(3 or 4, 3)"""
        return self.surfaces.corners[patch, : self.surfaces.corner_count[patch]]

    def points(self, random: np.random.Generator, n: int) -> Points:
        """Points (n, 3) in and a little around the bounding box."""
        corners = self.surfaces.corners.reshape(-1, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        return random.uniform(low - 0.1 * self.surfaces.size, high + 0.1 * self.surfaces.size, (n, 3))

    def triangles_without(self, *patches: int) -> FloatArray:
        """The opaque triangles of all other patches."""
        return self.surfaces.triangles[~np.isin(self.surfaces.triangle_patch[:, 0], patches)]


def soup_of(polygons: list[Points]) -> Soup:
    objects = {
        str(k): SceneObject(str(k), Mesh(polygon, (tuple(range(len(polygon))),)), GREY)
        for k, polygon in enumerate(polygons)
    }
    surfaces = flatten(Scene(objects=objects))
    return Soup(surfaces, RayScene(surfaces.triangles, surfaces.center, surfaces.size))


_COORDINATE = st.integers(-8, 8).map(lambda k: k / 8.0)


@st.composite
def polygons(draw: st.DrawFn, loose: bool = False) -> Points:
    """A triangle, a parallelogram or a kite; axis-parallel ones are common, as they are in rooms."""
    center = np.array([draw(_COORDINATE) for _ in range(3)])
    if draw(st.booleans()) and not loose:
        axis = draw(st.integers(0, 2))
        u, v = np.roll([0.0, 1.0, 0.0], axis), np.roll([0.0, 0.0, 1.0], axis)
        if draw(st.booleans()):
            u, v = v, u
    else:
        random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
        u, v = np.linalg.qr(random.normal(size=(3, 2)))[0].T
    a, b = (draw(st.sampled_from([0.1, 0.25, 0.5, 1.0])) for _ in range(2))
    flat = {
        "triangle": [[-a, -b], [a, -b], [0.3 * a, b]],
        "parallelogram": [[-a, -b], [a, -b], [1.2 * a, b], [-0.8 * a, b]],
        "kite": [[0, -b], [a, 0], [0, 0.6 * b], [-a, 0]],
    }[draw(st.sampled_from(["triangle", "parallelogram", "kite"]))]
    return np.asarray(center + np.array(flat) @ np.stack([u, v]))


@st.composite
def soups(draw: st.DrawFn, most: int = 12, anywhere: bool = False) -> Soup:
    """2 to `most` polygons, of any size and up to a thousand sizes from the origin if `anywhere`."""
    made = draw(st.lists(polygons(), min_size=2, max_size=most))
    if anywhere:
        scale = draw(st.sampled_from([1e-3, 1.0, 1e4]))
        shift = scale * np.array([draw(st.sampled_from([0.0, -7.0, 1e3])) for _ in range(3)])
        made = [scale * polygon + shift for polygon in made]
    return soup_of(made)
