"""Triangles of cells: those of the cells that changed are new, the others stay true whatever has changed."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.errors import SolverError
from solver.illumination.meshing.cell_lines import CellLines
from solver.illumination.meshing.delaunay import LibraryError, constrained_triangles
from solver.illumination.meshing.linework import Linework
from solver.illumination.meshing.patterns import pattern_triangles
from solver.illumination.meshing.ragged import spread, starts_of
from solver.illumination.meshing.tiling import settle_tiling
from solver.illumination.meshing.unchanged import find_unchanged
from solver.kernels import kernel
from solver.transport.pace import Pace
from solver.types import Int64Array, IntArray

_PLAIN: Final = 8
"""Places in a cell without lines that take the time of one in a cell with lines."""


class TriangulationError(SolverError):
    """The triangles of a patch do not tile its cells."""

    def __init__(self, patch: int, reason: str) -> None:
        self.patch = patch
        super().__init__(f"patch {patch} has no valid triangulation: {reason}")


@dataclass(frozen=True, eq=False)
class CellTriangles:
    """t triangles of n cells, in the order of the linework that they follow from."""

    start: IntArray
    """(n + 1,) where each cell's triangles begin"""
    corners: IntArray
    """(t, 3) places in the cell, counter-clockwise"""

    def take(self, cells: IntArray) -> CellTriangles:
        """Those of some `cells` (m,), in that order."""
        count = np.diff(self.start)[cells]
        return CellTriangles(starts_of(count), self.corners[spread(self.start[cells], count)])

    def nodes(self, lines: Linework) -> IntArray:
        """(t, 3) nodes of `lines`."""
        found = np.empty_like(self.corners)
        _look_up(self.start, self.corners, lines.start, lines.node, found)
        return found


def triangulate_cells(
    lines: Linework, known: Linework | None = None, kept: CellTriangles | None = None
) -> Generator[None, None, tuple[CellTriangles, Int64Array]]:
    """Triangles of all cells of `lines`, and the cells that are new: the others keep those they had.

    Those are the cells that are drawn as in `known`, whose triangles are `kept`. Yields every few
    milliseconds. Raises TriangulationError where triangles do not tile a cell.
    """
    n = len(lines.corner_count)
    if known is None or kept is None:
        before = np.full(n, -1, dtype=np.int32)
        kept = CellTriangles(np.zeros(1, dtype=np.int32), np.empty((0, 3), dtype=np.int32))
    else:
        before = yield from find_unchanged(lines, known)
    fresh = np.flatnonzero(before < 0)
    parts = [kept]
    for part in Pace().batches(_cost(lines)[fresh]):
        parts.append(_triangles_of(lines, fresh[part]))
        yield
    # Behind the cells that there were, the fresh ones.
    everything = _joined(parts)
    before[fresh] = np.arange(len(fresh), dtype=np.int32) + np.int32(len(kept.start) - 1)
    return everything.take(before), fresh


def _cost(lines: Linework) -> Int64Array:
    """(n,) what triangulating each cell takes, relative to the others."""
    places, edges = np.diff(lines.start), np.diff(lines.edge_start)
    return np.where(edges > 0, places + edges, 1 + places // _PLAIN).astype(np.int64)


def _triangles_of(lines: Linework, cells: Int64Array) -> CellTriangles:
    """Triangles of some `cells`, by pattern where there is one."""
    drawn = CellLines.of(lines, cells)
    corners, row, left = pattern_triangles(drawn)
    try:
        cut, cut_row = constrained_triangles(drawn.take(left))
    except LibraryError as error:
        raise TriangulationError(int(lines.cell_patch[cells[left[error.row]]]), error.reason) from error
    row = np.concatenate([row, left[cut_row]])
    corners = np.concatenate([corners, cut])[np.argsort(row, kind="stable")]
    start = starts_of(np.bincount(row, minlength=len(cells)))
    bad = settle_tiling(drawn, start, corners)
    if bad >= 0:
        raise TriangulationError(int(lines.cell_patch[cells[bad]]), "triangles overlap or leave gaps")
    return CellTriangles(start, corners)


def _joined(parts: list[CellTriangles]) -> CellTriangles:
    count = np.concatenate([np.diff(part.start) for part in parts])
    return CellTriangles(starts_of(count), np.concatenate([part.corners for part in parts]))


@kernel
def _look_up(
    start: IntArray, corners: IntArray, place_start: IntArray, node: IntArray, found: IntArray
) -> None:
    for cell in range(len(start) - 1):
        for t in range(start[cell], start[cell + 1]):
            for k in range(3):
                found[t, k] = node[place_start[cell] + corners[t, k]]
