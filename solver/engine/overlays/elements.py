"""The element hierarchy, cut at a depth, with what it carries ([H B.4.1, B.4.2])."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np

from solver.engine.overlays.base import FIRST_PAGE, Overlay, Page, Shown, Subject, Work, index_of, or_none
from solver.engine.overlays.shapes import BLACK, WHITE, Shapes, faces, outlines
from solver.transport.elements import ElementTree
from solver.transport.field import RadiosityField
from solver.transport.pushpull import means
from solver.types import BoolArray, FloatArray, IntArray, Spectra


class MeshColour(StrEnum):
    """What the faces of elements are coloured by."""

    RADIOSITY = "radiosity"
    """The mean that an element carries; what emits is white"""
    RHO = "rho"
    """Reflectance"""


@dataclass(frozen=True)
class MeshOverlay(Overlay):
    """The elements of a depth, and the leaves above it: together they tile the surfaces."""

    name: ClassVar[str] = "mesh"
    depth: int | None = None
    """0 for the patches themselves; None: the leaves"""
    element: int | None = None
    """Only what this one consists of"""
    colour: MeshColour = MeshColour.RADIOSITY
    page: Page = FIRST_PAGE

    def show(self, subject: Subject) -> Work:
        """One item an element. Raises SceneError naming `element`."""
        yield
        state, surfaces = subject.solution.solver.state, subject.world.surfaces
        tree = state.tree
        if self.element is not None:
            index_of(self.element, len(tree), "element", "elements")
        depth = depths(tree)
        chosen: BoolArray = np.asarray(tree.child < 0)
        if self.depth is not None:
            chosen = (depth == self.depth) | (chosen & (depth < self.depth))
        if self.element is not None:
            chosen = chosen & within(tree, self.element)
        ids = np.flatnonzero(chosen).astype(np.int32)
        shown = self.page.of(ids)
        patch = tree.patch[shown]
        corners, count = tree.corners[shown], tree.corner_count[shown]
        field = subject.solution.field()
        radiosity = mean_radiosity(tree, field, shown)
        emits = np.asarray(surfaces.emission.any(axis=1))
        colour, scale = surfaces.reflectance[patch], 1.0
        if self.colour is MeshColour.RADIOSITY:
            # The brightest leaf that only reflects is drawn as 1, whatever is shown of the elements.
            scale = float(field.radiosity[~emits[field.patch]].max(initial=0.0))
            colour = np.where(emits[patch, None], WHITE, _shades(radiosity, scale))
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(ids),
            facts={
                "solution": subject.solution.version,
                "objects": surfaces.object_ids,
                "colour": self.colour.value,
                "colour_scale": scale,
            },
            columns={
                "element": shown,
                "parent": or_none(tree.parent[shown]),
                "depth": depth[shown],
                "leaf": tree.child[shown] < 0,
                "patch": patch,
                "object": surfaces.object[patch],
                "face": surfaces.face[patch],
                "corners": corners,
                "corner_count": count,
                "area": tree.area[shown],
                "radiosity": radiosity,
                "reflectance": surfaces.reflectance[patch],
                "rgb": colour,
            },
            shapes=Shapes(lines=outlines(corners, count, BLACK), triangles=faces(corners, count, colour)),
        )


def _shades(radiosity: Spectra, scale: float) -> FloatArray:
    """(n, 3) colours; `scale` in W/m2 is drawn as 1."""
    return (radiosity / scale).clip(0.0, 1.0) if scale > 0.0 else np.zeros_like(radiosity)


def depths(tree: ElementTree) -> IntArray:
    """(n,) how often the patch has been split to make each element."""
    depth = np.zeros(len(tree), dtype=np.int32)
    below = np.flatnonzero(tree.parent >= 0)
    above = tree.parent[below]
    while len(below):
        depth[below] += 1
        more = tree.parent[above] >= 0
        below, above = below[more], tree.parent[above[more]]
    return depth


def within(tree: ElementTree, element: int) -> BoolArray:
    """(n,) whether each element is a part of `element`, or itself."""
    inside = np.zeros(len(tree), dtype=np.bool_)
    inside[element] = True
    part = np.array([element], dtype=np.int32)
    while len(part):
        is_split = np.flatnonzero(tree.child[part] >= 0)
        part = part[is_split]
        count = tree.child_count[part]
        starts = np.repeat(tree.child[part] - np.cumsum(count) + count, count)
        part = (starts + np.arange(len(starts))).astype(np.int32)
        inside[part] = True
    return inside


def mean_radiosity(tree: ElementTree, field: RadiosityField, elements: IntArray) -> Spectra:
    """(m, 3) W/m2 of `elements` (m,), from the leaves of `field` that they consist of."""
    functions = np.zeros((len(tree), 3, 3))
    functions[tree.leaves, 0] = field.radiosity
    return means(tree, functions)[elements]
