"""How far a solution is from where an edit leads [G eq. 7]: over all elements, and where it changes most.

All solutions are told on the same elements, the leaves of one mesh of the edited scene: of a solution that is
finer there the mean is taken, of one that is coarser its linear function at the element's centroid, which is
the element's mean of it. Told is what is reflected. The paper's luminances have emission in them, too, which
every method knows from the start: beside that of the lamps all errors would look smaller.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.engine.world import World
from solver.redistribution.matching import match_patches
from solver.transport.elements import ElementTree
from solver.transport.places import leaves_at
from solver.transport.state import TransportState
from solver.types import BoolArray, FloatArray, IntArray, Points

MOST: Final = 0.01
"""Share of the elements, by their count, that is told apart as those that change most"""

_SAME: Final = 0.75
"""An element of more than this part of the area of another at the same place is not a child of it."""


@dataclass(frozen=True)
class EditError:
    """Root of the squared error, weighted by area, over that of the reference [G eq. 7]."""

    everywhere: float
    where_most: float
    """Over the elements that change most between the converged solutions before and after"""


class EditWitness:
    """Tells solutions of one edited scene against a reference."""

    def __init__(self, world: World, tree: ElementTree, reference: TransportState) -> None:
        """Take the leaves of `tree`, a mesh of `world`, as the elements that errors are told on."""
        self._world = world
        self._tree = tree
        self.leaves: IntArray = tree.leaves
        self._reference = self.luminances(reference)

    def most_changed(self, world: World, before: TransportState) -> BoolArray:
        """(m,) which elements an edit of `world`, of converged solution `before`, changes most.

        Parts of an object that moves are told against themselves where they were before; those of one that
        comes were dark.
        """
        change = np.abs(self._reference - self._luminances_before(world, before))
        count = max(1, round(MOST * len(change)))
        most = np.zeros(len(change), dtype=np.bool_)
        most[np.argpartition(change, -count)[-count:]] = True
        return most

    def error(self, luminance: FloatArray, most: BoolArray, truth: FloatArray | None = None) -> EditError:
        """The error of reflected luminances (m,) of the elements, W/m2, of which some change `most` (m,).

        It is told against `truth` (m,), None for the reference.
        """
        truth = self._reference if truth is None else truth
        area = self._tree.area[self.leaves]
        square = area * (luminance - truth) ** 2
        norm = area * truth**2
        return EditError(
            float(np.sqrt(square.sum() / norm.sum())), float(np.sqrt(square[most].sum() / norm[most].sum()))
        )

    def luminances(self, state: TransportState) -> FloatArray:
        """Mean luminance (m,) that elements reflect by a solution of the edited scene, W/m2."""
        mine, theirs = self._tree, state.tree
        middle, patch = mine.centroid[self.leaves], mine.patch[self.leaves]
        at = leaves_at(theirs, middle, patch)
        found = _reflected(state, at, middle)
        # Where the solution is finer: the mean of its leaves.
        area = mine.area[self.leaves]
        finer = theirs.area[at] < _SAME * area
        leaves = theirs.leaves
        held = np.empty(len(mine), dtype=np.int64)
        held[self.leaves] = np.arange(len(self.leaves))
        inside = held[leaves_at(mine, theirs.centroid[leaves], theirs.patch[leaves])]
        flux = theirs.area[leaves] * _reflected(state, leaves, theirs.centroid[leaves])
        total = np.bincount(inside, flux, len(self.leaves))
        return np.asarray(np.where(finer, total / area, found))

    def _luminances_before(self, world: World, state: TransportState) -> FloatArray:
        """Reflected luminance (m,) at the elements' middles, where these were before the edit; W/m2."""
        patch = self._tree.patch[self.leaves]
        earlier = match_patches(world.surfaces, self._world.surfaces).likeness[patch]
        there = np.flatnonzero(earlier >= 0)
        middle = self._places_before(world, self._tree.centroid[self.leaves[there]], patch[there])
        found = np.zeros(len(patch))
        found[there] = _reflected(state, leaves_at(state.tree, middle, earlier[there]), middle)
        return found

    def _places_before(self, world: World, positions: Points, patch: IntArray) -> Points:
        """Where points (k, 3) of patches (k,) were before their objects moved."""
        surfaces, scene = self._world.surfaces, self._world.scene
        owner = surfaces.object[patch]
        placed = positions.copy()
        for number in np.unique(owner).tolist():
            name = surfaces.object_ids[number]
            now, then = scene.object(name).transform, world.scene.object(name).transform
            if not np.array_equal(now.matrix, then.matrix):
                moved = then.matrix @ np.linalg.inv(now.matrix)
                rows = owner == number
                placed[rows] = positions[rows] @ moved[:3, :3].T + moved[:3, 3]
        return placed


def _reflected(state: TransportState, elements: IntArray, positions: Points) -> FloatArray:
    """Luminance (k,) that leaves `elements` (k,) reflect at points (k, 3) of them, none of it negative."""
    tree = state.tree
    patch = tree.patch[elements]
    offset = np.einsum("kua,ka->ku", tree.axes[patch], positions - tree.centroid[elements])
    received = state.received[elements]
    irradiance = received[:, 0] + np.einsum("ku,kuc->kc", offset, received[:, 1:])
    return np.asarray((state.reflectance[patch] * np.maximum(irradiance, 0.0)) @ state.weights)
