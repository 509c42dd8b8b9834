"""Small scenes that cast shadows, and their irradiance by clipping what each blocker hides of the lamp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from hypothesis import strategies as st

from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.geometry.transform import Transform
from solver.illumination.discontinuity.discontinuities import Discontinuities, find_discontinuities
from solver.types import FloatArray, IntArray, Points
from solver.visibility.bvh import Hierarchy, build_hierarchy

GREY = Material(np.full(3, 0.5), np.zeros(3))
LIGHT = Material(np.zeros(3), np.ones(3))
CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
SIDES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3))
"""Faces of CUBE seen from outside: z = 0, z = 1, x = 0, x = 1, y = 0, y = 1."""
HEIGHT = 2.0
"""Of lamps over the floor, which is 4 wide, around the origin."""


def square(half: float, z: float, down: bool = False, x: float = 0.0, y: float = 0.0) -> Points:
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return np.asarray((corners[::-1] if down else corners) + np.array([x, y, 0.0]))


def polygon(name: str, corners: Points, material: Material = GREY) -> SceneObject:
    return SceneObject(name, Mesh(corners, (tuple(range(len(corners))),)), material)


def solid(
    name: str,
    corners: Points,
    without: Sequence[int] = (),
    triangulated: bool = False,
) -> SceneObject:
    """A cube with the given corners (8, 3), perhaps without some of its SIDES."""
    faces: list[tuple[int, ...]] = [face for k, face in enumerate(SIDES) if k not in without]
    if triangulated:
        faces = [half for face in faces for half in (face[:3], (face[0], *face[2:]))]
    return SceneObject(name, Mesh(corners, tuple(faces)), GREY)


def box(low: Sequence[float], high: Sequence[float]) -> Points:
    """Corners (8, 3) of an axis-parallel box."""
    return np.asarray(np.array(low) + CUBE * (np.array(high) - np.array(low)))


FLOOR = polygon("floor", square(2.0, 0.0))
LAMP = polygon("lamp", square(0.5, HEIGHT, down=True), LIGHT)


def surfaces_of(*objects: SceneObject) -> Surfaces:
    """Patch 0 is the first object's, if it is one polygon."""
    return flatten(Scene(objects={o.id: o for o in objects}))


def hierarchy_of(surfaces: Surfaces) -> Hierarchy:
    return build_hierarchy(surfaces.corners, np.flatnonzero(surfaces.side == 0).astype(np.int32))


def emitters(surfaces: Surfaces) -> IntArray:
    return np.flatnonzero(surfaces.emission.max(axis=1) > 0.0).astype(np.int32)


def find(
    surfaces: Surfaces, receivers: Sequence[int] | None = None, keep_hidden: bool = False
) -> Discontinuities:
    """What the emitters and contacts make on the receivers."""
    chosen = None if receivers is None else np.array(receivers, dtype=np.int32)
    return find_discontinuities(
        surfaces, hierarchy_of(surfaces), emitters(surfaces), chosen, keep_hidden=keep_hidden
    )


def unordered(ends: FloatArray) -> set[tuple[tuple[float, ...], ...]]:
    """Segments (d, 2, 3) as a set, whichever way they run, to 9 digits."""
    rounded = np.round(ends, 9) + 0.0
    return {tuple(sorted(tuple(end.tolist()) for end in segment)) for segment in rounded}


@dataclass(frozen=True, eq=False)
class Shadows:
    """A floor under a level lamp, with convex blockers between that touch neither."""

    lamp: Points
    """(n, 3) at HEIGHT, facing down"""
    blockers: tuple[Points, ...]
    """Their corners (m, 3)"""
    surfaces: Surfaces
    """Floor, lamp, blockers"""

    def irradiance(self, point: FloatArray) -> float:
        """Form factor from a point of the floor to the lamp, exact."""
        seen = shapely.Polygon(self.lamp[:, :2])
        for blocker in self.blockers:
            spread = HEIGHT / blocker[:, 2:]
            hidden = point[:2] + (blocker[:, :2] - point[:2]) * spread
            seen = seen.difference(shapely.MultiPoint(hidden).convex_hull)
        total = 0.0
        for part in shapely.get_parts(seen):
            if isinstance(part, shapely.Polygon) and not part.is_empty:
                clockwise = shapely.geometry.polygon.orient(part, -1.0)
                for ring in (clockwise.exterior, *clockwise.interiors):
                    total += _ring_factor(np.asarray(ring.coords) - point[:2])
        return total

    def along(self, start: FloatArray, step: FloatArray, places: FloatArray) -> FloatArray:
        """Irradiance at start + place step, for all places (n,)."""
        return np.array([self.irradiance(start + place * step) for place in places])


def _ring_factor(ring: FloatArray) -> float:
    """Lambert's formula for a closed ring (n, 2) at HEIGHT, seen from the origin, which looks up."""
    a = np.column_stack([ring[:-1], np.full(len(ring) - 1, HEIGHT)])
    b = np.column_stack([ring[1:], np.full(len(ring) - 1, HEIGHT)])
    cross = np.cross(a, b - a)
    length = np.linalg.norm(cross, axis=1)
    kept = length > 0.0
    angle = np.arctan2(length[kept], np.einsum("ij,ij->i", a, b)[kept])
    return float(-(angle * cross[kept, 2] / length[kept]).sum() / (2.0 * np.pi))


@st.composite
def shadows(draw: st.DrawFn, blockers: int = 1, sheets: bool = True) -> Shadows:
    """Turned boxes, or sheets, under a turned lamp, in general position."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    angle = random.uniform(0.0, np.pi)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    flat = square(1.0, HEIGHT, down=True)[:, :2] * random.uniform(0.2, 0.6, 2) @ turn
    lamp = np.column_stack([flat + random.uniform(-0.3, 0.3, 2), np.full(4, HEIGHT)])
    objects = [FLOOR, polygon("lamp", lamp, LIGHT)]
    corners = []
    for k in range(blockers):
        place = Transform.from_parts(
            np.array([*random.uniform(-0.5, 0.5, 2), random.uniform(0.6, 1.2)]),
            random.normal(size=4),
            random.uniform(0.2, 0.6, 3),
        )
        if sheets and draw(st.integers(0, 3)) == 0:
            corners.append(place.apply(square(0.5, 0.0)))
            objects.append(polygon(f"blocker{k}", corners[-1]))
        else:
            corners.append(place.apply(CUBE - 0.5))
            objects.append(solid(f"blocker{k}", corners[-1]))
    return Shadows(lamp, tuple(corners), surfaces_of(*objects))
