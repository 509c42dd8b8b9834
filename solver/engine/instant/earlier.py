"""What virtual lights saw before an edit: maps that are true but where something was, or is ([K 4.3])."""

from __future__ import annotations

import numpy as np

from solver.illumination.particles.lighting import ShiningLights
from solver.illumination.particles.receivers import Polygons
from solver.illumination.particles.sights import Known, Sights, join_sights
from solver.redistribution.matching import match_patches
from solver.redistribution.reach import boxes_around
from solver.tolerances import TOUCH
from solver.types import Float32Array, IntArray

_PLACE = 6
"""Rows of a light's frame that tell where it is and which way it faces; the others follow."""


class EarlierSights:
    """The maps of an earlier world's lights, for lights that are in the same places."""

    def __init__(
        self, seen: dict[int, list[tuple[ShiningLights, Sights]]], before: Polygons, after: Polygons
    ) -> None:
        """`seen` by the lights of each block, batch by batch."""
        self._seen = seen
        self._joined: dict[int, tuple[Float32Array, Sights]] = {}
        match = match_patches(before.surfaces, after.surfaces)
        self._renumbered = _renumbered(before, after, match.number)
        fresh = match.fresh
        polygon = after.of_patch[fresh]
        boxes = boxes_around(after.corners[polygon].astype(np.float64), after.surfaces.object[fresh])
        boxes[:, 0] -= TOUCH
        boxes[:, 1] += TOUCH
        self._boxes = boxes.astype(np.float32)

    def of(self, number: int, lights: ShiningLights) -> Known | None:
        """What is known of `lights` of the block `number`; None if nothing is."""
        if not self._seen.get(number):
            return None
        if number not in self._joined:
            batches = self._seen[number]
            places = np.concatenate([batch.frames[:_PLACE] for batch, _ in batches], axis=1)
            self._joined[number] = places, join_sights([sights for _, sights in batches])
        places, sights = self._joined[number]
        row = _find(np.ascontiguousarray(places.T), np.ascontiguousarray(lights.frames[:_PLACE].T))
        return Known(sights, row, self._renumbered, self._boxes) if np.any(row >= 0) else None

    def forget(self, number: int) -> None:
        """The block `number` has maps of its own."""
        self._seen.pop(number, None)
        self._joined.pop(number, None)


def _renumbered(before: Polygons, after: Polygons, patch: IntArray) -> IntArray:
    """(q before + 1,) the present number of each polygon, -1 where it is gone, by that of each `patch`."""
    number = np.full(len(before) + 1, -1, dtype=np.int32)
    number[0] = 0
    fronts = np.flatnonzero((before.surfaces.side == 0) & (before.of_patch > 0))
    stays = fronts[patch[fronts] >= 0]
    number[before.of_patch[stays]] = after.of_patch[patch[stays]]
    return number


def _find(known: Float32Array, wanted: Float32Array) -> IntArray:
    """(n,) which of `known` (m, k) each of `wanted` (n, k) is, to the last bit; -1 where none is."""
    both = np.concatenate([known, wanted]).view([("", np.float32)] * known.shape[1]).ravel()
    _, first, place = np.unique(both, return_index=True, return_inverse=True)
    found = first[place[len(known) :]]
    return np.where(found < len(known), found, -1).astype(np.int32)
