"""Which leaves of a subdivision each discontinuity passes through ([H 5.5.5, 5.5.6]).

[H] hands discontinuities down the quadtrees, clipped, as elements are split. Here they stay whole, on their
patches, and leaves of whatever origin are found by geometry: every patch has a grid of about as many cells
as it has leaves, each cell the leaves that reach into it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.discontinuity.segments import clip
from solver.illumination.discontinuity.sets import DiscontinuitySets
from solver.illumination.meshing.cells import Leaves
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.transport.elements import plane_axes
from solver.types import FloatArray, Int64Array, IntArray

LEAF_BORDER: Final = 1e-6
"""A line passes through a leaf if some of it is further inside than this times the leaf's size."""

_CHUNK: Final = 1024
_LEAST: Final = 128


@dataclass(frozen=True, eq=False)
class LeafCrossings:
    """Where d discontinuities pass through n leaves: c pairs, sorted by discontinuity."""

    leaf_count: int
    """n"""
    start: Int64Array
    """(d + 1,) first pair of each discontinuity"""
    leaf: IntArray
    """(c,)"""
    extent: FloatArray
    """(c,) how far the leaf reaches across the discontinuity, m"""

    @property
    def size(self) -> FloatArray:
        """(d,) the widest leaf across each discontinuity, m; 0 if it passes through none.

        What runs along borders of leaves only needs no edge: they part what it parts.
        """
        widest = np.zeros(len(self.start) - 1)
        through = np.flatnonzero(np.diff(self.start) > 0)
        if len(through):
            widest[through] = np.maximum.reduceat(self.extent, self.start[through])
        return widest


def find_crossings(surfaces: Surfaces, sets: DiscontinuitySets, leaves: Leaves) -> LeafCrossings:
    """Which of the leaves each discontinuity of `sets` passes through, on its set's line."""
    axes = plane_axes(surfaces.normal)
    # All in the planes of the patches, from their first corners.
    n, d = len(leaves.patch), len(sets.member)
    flat = _flatten(leaves.corners, leaves.patch, surfaces, axes)
    segment = _flatten(sets.ends, sets.patch[sets.member], surfaces, axes)
    patch_flat = _flatten(surfaces.corners, np.arange(surfaces.patch_count), surfaces, axes)
    low = patch_flat.min(axis=1)
    per_patch = np.bincount(leaves.patch, minlength=surfaces.patch_count)
    side = np.maximum(1, np.ceil(np.sqrt(per_patch))).astype(np.int32)
    step = (patch_flat.max(axis=1) - low) / side[:, None]
    first = np.concatenate([[0], np.cumsum(side.astype(np.int64) ** 2)])
    cell_start = np.zeros(int(first[-1]) + 1, dtype=np.int64)
    _fill_cells(flat, leaves.patch, low, step, side, first, False, cell_start[1:], np.empty(0, np.int32))
    np.cumsum(cell_start, out=cell_start)
    held = np.empty(int(cell_start[-1]), dtype=np.int32)
    _fill_cells(flat, leaves.patch, low, step, side, first, True, cell_start[:-1].copy(), held)

    patch = sets.patch[sets.member]
    start = np.zeros(d + 1, dtype=np.int64)
    none, nothing = np.empty(0, dtype=np.int32), np.empty(0)

    def count(begin: int, end: int) -> None:
        _cross(segment, patch, flat, leaves.corner_count, low, step, side, first, cell_start, held, begin,
               end, False, start[1:], none, nothing)  # fmt: skip

    run_chunks(count, d, _CHUNK, _LEAST)
    np.cumsum(start, out=start)
    leaf, extent = np.empty(int(start[-1]), dtype=np.int32), np.empty(int(start[-1]))

    def fill(begin: int, end: int) -> None:
        _cross(segment, patch, flat, leaves.corner_count, low, step, side, first, cell_start, held, begin,
               end, True, start, leaf, extent)  # fmt: skip

    run_chunks(fill, d, _CHUNK, _LEAST)
    return LeafCrossings(n, start, leaf, extent)


def _flatten(
    points: FloatArray, patch: IntArray | Int64Array, surfaces: Surfaces, axes: FloatArray
) -> FloatArray:
    """Points (n, k, 3) of patches (n,) in their planes' axes, from their first corners, (n, k, 2) metres."""
    local = points - surfaces.corners[patch, 0][:, None]
    return np.ascontiguousarray(np.einsum("nki,nai->nka", local, axes[patch]))


@kernel
def _cell(x: float, low: float, step: float, side: int) -> int:
    """Which of the `side` cells of a grid's axis holds x."""
    return int(min(side - 1, max(0, math.floor((x - low) / step))))


@kernel
def _fill_cells(
    flat: FloatArray,
    patch: IntArray,
    low: FloatArray,
    step: FloatArray,
    side: IntArray,
    first: Int64Array,
    write: bool,
    slot: Int64Array,
    held: IntArray,
) -> None:
    """Count in slot, or write from slot on, the leaves (n, 4, 2) that reach into each cell of the grids."""
    for i in range(len(flat)):
        p = patch[i]
        range_of = np.empty((2, 2), dtype=np.int64)
        for axis in range(2):
            least = math.inf
            most = -math.inf
            for k in range(4):
                least = min(least, flat[i, k, axis])
                most = max(most, flat[i, k, axis])
            range_of[axis, 0] = _cell(least, low[p, axis], step[p, axis], side[p])
            range_of[axis, 1] = _cell(most, low[p, axis], step[p, axis], side[p])
        for x in range(range_of[0, 0], range_of[0, 1] + 1):
            for y in range(range_of[1, 0], range_of[1, 1] + 1):
                cell = first[p] + x * side[p] + y
                if write:
                    held[slot[cell]] = i
                slot[cell] += 1


@kernel
def _width_if_crossed(leaf: FloatArray, n: int, x0: float, y0: float, x1: float, y1: float) -> float:
    """Extent of a leaf (4, 2) across a segment that passes through it, m; -1 if it does not."""
    dx = x1 - x0
    dy = y1 - y0
    length = math.sqrt(dx * dx + dy * dy)
    lowest = math.inf
    highest = -math.inf
    size = 0.0
    for k in range(n):
        across = (dx * (leaf[k, 1] - y0) - dy * (leaf[k, 0] - x0)) / length
        lowest = min(lowest, across)
        highest = max(highest, across)
        opposite = (k + 2) % n
        size = max(size, math.hypot(leaf[opposite, 0] - leaf[k, 0], leaf[opposite, 1] - leaf[k, 1]))
    inset = LEAF_BORDER * size
    if lowest >= -inset or highest <= inset:
        return -1.0
    t0 = 0.0
    t1 = 1.0
    for k in range(n):
        m = (k + 1) % n
        ex = leaf[m, 0] - leaf[k, 0]
        ey = leaf[m, 1] - leaf[k, 1]
        edge = math.sqrt(ex * ex + ey * ey)
        g0 = (ex * (y0 - leaf[k, 1]) - ey * (x0 - leaf[k, 0])) / edge - inset
        g1 = (ex * (y1 - leaf[k, 1]) - ey * (x1 - leaf[k, 0])) / edge - inset
        t0, t1 = clip(g0, g1, t0, t1)
    if (t1 - t0) * length <= inset:
        return -1.0
    return highest - lowest


@kernel
def _cross(
    segment: FloatArray,
    patch: IntArray,
    flat: FloatArray,
    counts: IntArray,
    low: FloatArray,
    step: FloatArray,
    side: IntArray,
    first: Int64Array,
    cell_start: Int64Array,
    held: IntArray,
    begin: int,
    end: int,
    write: bool,
    slot: Int64Array,
    leaf: IntArray,
    extent: FloatArray,
) -> None:
    """Count in slot, or write from slot on, the leaves that segments [begin, end), (d, 2, 2), cross."""
    seen = np.full(len(flat), -1, dtype=np.int32)
    for i in range(begin, end):
        p = patch[i]
        found = 0
        a = 0 if segment[i, 0, 0] <= segment[i, 1, 0] else 1
        x0 = segment[i, a, 0]
        y0 = segment[i, a, 1]
        x1 = segment[i, 1 - a, 0]
        y1 = segment[i, 1 - a, 1]
        column0 = _cell(x0, low[p, 0], step[p, 0], side[p])
        column1 = _cell(x1, low[p, 0], step[p, 0], side[p])
        for column in range(column0, column1 + 1):
            # Where the segment enters and leaves this column of the grid.
            enters = y0
            leaves = y1
            if column > column0:
                enters = y0 + (y1 - y0) * (low[p, 0] + column * step[p, 0] - x0) / (x1 - x0)
            if column < column1:
                leaves = y0 + (y1 - y0) * (low[p, 0] + (column + 1) * step[p, 0] - x0) / (x1 - x0)
            row0 = _cell(min(enters, leaves), low[p, 1], step[p, 1], side[p])
            row1 = _cell(max(enters, leaves), low[p, 1], step[p, 1], side[p])
            for row in range(row0, row1 + 1):
                cell = first[p] + column * side[p] + row
                for entry in range(cell_start[cell], cell_start[cell + 1]):
                    candidate = held[entry]
                    if seen[candidate] == i:
                        continue
                    seen[candidate] = i
                    across = _width_if_crossed(flat[candidate], counts[candidate], x0, y0, x1, y1)
                    if across < 0.0:
                        continue
                    if write:
                        leaf[slot[i] + found] = candidate
                        extent[slot[i] + found] = across
                    found += 1
        if not write:
            slot[i] = found
