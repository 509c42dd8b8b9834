"""Leaves of a field in blocks, one a patch, and which blocks are as they were before.

An edit or a round of refinement changes the leaves of some patches. What follows from the leaves of the
others can be kept, wherever these have moved to in the field.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.cells import Cells, Leaves
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import BoolArray, Corners, Int64Array, IntArray

_PATCHES: Final = 128
"""Patches of a piece of work"""


@dataclass(frozen=True, eq=False)
class LeafBlocks:
    """n leaves of p patches, patch by patch; those of one patch in the order that their field has them in."""

    field: Leaves
    """Whose leaves these are, in its own order"""
    order: IntArray
    """(n,) number of each leaf in the field"""
    corner_count: IntArray
    """(n,)"""
    patch: IntArray
    """(n,)"""
    start: IntArray
    """(p + 1,) where the leaves of each patch begin"""

    @staticmethod
    def of(leaves: Leaves, patch_count: int) -> LeafBlocks:
        """The blocks of `leaves`."""
        n = len(leaves.patch)
        start = np.zeros(patch_count + 1, dtype=np.int32)
        order = np.empty(n, dtype=np.int32)
        _sort(leaves.patch, start, order)
        return LeafBlocks(leaves, order, leaves.corner_count[order], leaves.patch[order], start)

    @staticmethod
    def none() -> LeafBlocks:
        """No leaves of no patches."""
        nothing = np.empty(0, dtype=np.int32)
        return LeafBlocks.of(Cells(np.empty((0, 4, 3)), nothing, nothing, nothing), 0)

    @property
    def corners(self) -> Corners:
        """(n, 4, 3) metres, gathered with every call."""
        return self.field.corners.take(self.order, axis=0)

    def only(self, chosen: BoolArray) -> LeafBlocks:
        """The same with no leaves but those of the patches (p,) that are `chosen`."""
        if chosen.all():
            return self
        kept = np.flatnonzero(chosen[self.patch])
        start = np.zeros_like(self.start)
        np.cumsum(np.where(chosen, np.diff(self.start), 0), out=start[1:])
        return LeafBlocks(self.field, self.order[kept], self.corner_count[kept], self.patch[kept], start)

    def as_before(self, before: LeafBlocks, earlier: IntArray) -> IntArray:
        """`earlier` (p,), a patch of `before` or -1 for each, with -1 for all whose leaves differ."""
        same = earlier.copy()
        ours, theirs = (_bits(blocks.field.corners) for blocks in (self, before))
        run_chunks(
            lambda begin, end: _compare(
                begin, end, self.start, self.order, self.corner_count, ours,
                before.start, before.order, before.corner_count, theirs, same,
            ),
            len(same),
            _PATCHES,
        )  # fmt: skip
        return same


def earlier_patches(surfaces: Surfaces, before: Surfaces) -> IntArray:
    """For each patch of `surfaces` the one that may be it in `before`, or -1.

    That is the one of the same rank in the object of the same name, if that has as many patches still.
    """
    if surfaces is before:
        return np.arange(surfaces.patch_count, dtype=np.int32)
    known = {name: index for index, name in enumerate(before.object_ids)}
    match = np.array([known.get(name, -1) for name in surfaces.object_ids], dtype=np.int64)
    first, count = _runs(surfaces)
    # A row of nothing at the end, for objects that are new.
    first_before, count_before = (np.append(runs, 0) for runs in _runs(before))
    offset = first_before[match] - first
    stays = (match >= 0) & (count == count_before[match])
    patch = np.arange(surfaces.patch_count) + offset[surfaces.object]
    return np.where(stays[surfaces.object], patch, -1).astype(np.int32)


def _runs(surfaces: Surfaces) -> tuple[Int64Array, Int64Array]:
    """First patch and number of patches of each object."""
    count = np.bincount(surfaces.object, minlength=len(surfaces.object_ids))
    return np.cumsum(count) - count, count


def _bits(corners: Corners) -> Int64Array:
    return np.ascontiguousarray(corners).view(np.int64)


@kernel
def _sort(patch: IntArray, start: IntArray, order: IntArray) -> None:
    """A counting sort by patch, stable."""
    for leaf in range(len(patch)):
        start[patch[leaf] + 1] += 1
    for p in range(len(start) - 1):
        start[p + 1] += start[p]
    place = start.copy()
    for leaf in range(len(patch)):
        order[place[patch[leaf]]] = leaf
        place[patch[leaf]] += 1


@kernel
def _compare(
    begin: int,
    end: int,
    start: IntArray,
    order: IntArray,
    count: IntArray,
    bits: Int64Array,
    start_before: IntArray,
    order_before: IntArray,
    count_before: IntArray,
    bits_before: Int64Array,
    earlier: IntArray,
) -> None:
    for p in range(begin, end):
        q = earlier[p]
        if q < 0:
            continue
        first = start[p]
        shift = start_before[q] - first
        same = start[p + 1] - first == start_before[q + 1] - start_before[q]
        leaf = first
        while same and leaf < start[p + 1]:
            same = count[leaf] == count_before[leaf + shift]
            a = order[leaf]
            b = order_before[leaf + shift]
            for k in range(4):
                for axis in range(3):
                    same &= bits[a, k, axis] == bits_before[b, k, axis]
            leaf += 1
        if not same:
            earlier[p] = -1
