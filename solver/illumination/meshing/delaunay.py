"""Constrained Delaunay triangles of cells with lines in them.

Cells lie side by side, each in a square of its own, and are triangulated in one call. Points are rounded to
a grid in their cell's frame on which squares begin at whole numbers: no square's place changes anything
between its points, and the library's predicates are exact. Ties are settled afterwards (`uniqueness`). What
a cell becomes depends on that cell alone, whichever cells it is triangulated with.
"""

from __future__ import annotations

from typing import Any, Final, cast

import numpy as np
import pythoncdt

from solver.illumination.meshing.cell_lines import CellLines
from solver.illumination.meshing.cell_plane import project
from solver.illumination.meshing.incircle import BITS
from solver.illumination.meshing.uniqueness import make_unique
from solver.kernels import kernel
from solver.types import FloatArray, Int64Array, IntArray, Points

_GRID: Final = 2.0**BITS
"""Points of the grid in a cell's diameter: points in its frame are at most one diameter from its centre. The
steps are far below what counts as flat (`tiling`)."""

_SQUARE: Final = 4.0
"""Side of the square that a cell has to itself, in diameters."""

_MOST_CELLS: Final = int(2.0**52 / _GRID / _SQUARE) ** 2
"""In one call: as many as leave the points of the last square exact in float64."""


class LibraryError(ValueError):
    """The library refuses a cell."""

    def __init__(self, row: int, reason: str) -> None:
        self.row = row
        self.reason = reason
        super().__init__(f"cell {row}: {reason}")


def constrained_triangles(lines: CellLines) -> tuple[IntArray, Int64Array]:
    """Triangles (t, 3) of `lines`, in places, and the cell of each, ascending.

    Raises LibraryError for a cell that the library refuses.
    """
    c = len(lines)
    if c == 0:
        return np.empty((0, 3), dtype=np.int32), np.empty(0, dtype=np.int64)
    if c > _MOST_CELLS:
        return _by_halves(lines)
    k, rings = len(lines.position), int(lines.ring_length.sum())
    across = int(np.ceil(np.sqrt(c)))
    whole, point = np.empty((k, 2), dtype=np.int64), np.empty((k, 2))
    edge = np.empty((rings + len(lines.edge), 2), dtype=np.int32)
    _lay_out(
        across, lines.ring_length, lines.start, lines.position, lines.edge_start, lines.edge, lines.center,
        lines.axes, whole, point, edge,
    )  # fmt: skip
    try:
        found = _library(point, edge)
    except RuntimeError as error:
        if c == 1:
            raise LibraryError(0, str(error)) from error
        return _by_halves(lines)
    found = make_unique(found, edge, whole)
    row = lines.place_row[found[:, 0]]
    return found - lines.start[row][:, None], row


def _by_halves(lines: CellLines) -> tuple[IntArray, Int64Array]:
    """As `constrained_triangles`, of more cells than fit, or of some among which one is refused."""
    parts = []
    for rows in np.array_split(np.arange(len(lines)), 2):
        try:
            triangles, row = constrained_triangles(lines.take(rows))
        except LibraryError as error:
            raise LibraryError(int(rows[error.row]), error.reason) from error
        parts.append((triangles, rows[row]))
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _library(points: FloatArray, edges: IntArray) -> IntArray:
    """Triangles (t, 3) within the rings that `edges` (e, 2) form, which contain all edges."""
    made = pythoncdt.Triangulation(
        pythoncdt.VertexInsertionOrder.AUTO, pythoncdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0
    )
    made.insert_vertices(cast("Any", points))
    made.insert_edges(cast("Any", edges.astype(np.uint32)))
    made.erase_outer_triangles()
    return np.asarray(made.triangles_array()["vertices"], dtype=np.int32)


@kernel
def _lay_out(
    across: int,
    ring_length: IntArray,
    start: IntArray,
    position: Points,
    edge_start: IntArray,
    edge: IntArray,
    center: Points,
    axes: FloatArray,
    whole: Int64Array,
    point: FloatArray,
    edges: IntArray,
) -> None:
    """Points (k, 2) on the grid, and in squares, `across` of them in a row; edges (e, 2) between points.

    They are laid out in their frames, so that Delaunay's criterion is that of the plane but for needles.
    """
    line = 0
    at = np.empty(2)
    for cell in range(len(ring_length)):
        begin = start[cell]
        for k in range(begin, start[cell + 1]):
            project(position[k], center[cell], axes[cell], at)
            for axis in range(2):
                rounded = np.rint(at[axis] * _GRID)
                square = cell % across if axis == 0 else cell // across
                whole[k, axis] = np.int64(rounded)
                point[k, axis] = rounded / _GRID + _SQUARE * square
        for k in range(ring_length[cell]):
            edges[line, 0] = begin + k
            edges[line, 1] = begin + (k + 1) % ring_length[cell]
            line += 1
        for k in range(edge_start[cell], edge_start[cell + 1]):
            edges[line, 0] = begin + edge[k, 0]
            edges[line, 1] = begin + edge[k, 1]
            line += 1
