"""Triangles of cells: constrained Delaunay triangulations where lines ask for it, patterns elsewhere.

The library's predicates are exact. All cells of a patch that are left to it lie side by side, each in a
square of its own, and are triangulated in one call: what a cell becomes depends on its patch alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, cast

import numpy as np
import pythoncdt

from solver.errors import SolverError
from solver.illumination.meshing.cell_plane import project
from solver.illumination.meshing.linework import Linework
from solver.illumination.meshing.patterns import pattern_triangles
from solver.illumination.meshing.skeleton import Skeleton
from solver.illumination.meshing.tiling import settle_tiling
from solver.kernels import kernel
from solver.types import BoolArray, FloatArray, IntArray, Points

_SQUARE: Final = 4.0
"""Side of the square that a cell has to itself, in diameters."""


class TriangulationError(SolverError):
    """The triangles of a patch do not tile its cells."""

    def __init__(self, patch: int, reason: str) -> None:
        self.patch = patch
        super().__init__(f"patch {patch} has no valid triangulation: {reason}")


@dataclass(frozen=True, eq=False)
class CellTriangles:
    """t triangles, sorted by cell."""

    triangles: IntArray
    """(t, 3) nodes, from the patch's first, counter-clockwise"""
    cell: IntArray
    """(t,) ascending"""


def triangulate_cells(
    lines: Linework, chosen: BoolArray, normals: FloatArray, skeleton: Skeleton
) -> CellTriangles:
    """Triangles of the cells of the patches that are `chosen` (p,), with normals (p, 3).

    Raises TriangulationError where triangles do not tile a cell.
    """
    cells = np.flatnonzero(chosen[lines.cell_patch]).astype(np.int32)
    triangles, cell, left = pattern_triangles(lines, cells)
    cut, cut_cell = _constrained(lines, left, skeleton)
    cell = np.concatenate([cell, cut_cell])
    order = np.argsort(cell, kind="stable")
    triangles, cell = np.concatenate([triangles, cut])[order], cell[order]
    bad = settle_tiling(lines, cells, triangles, cell, normals)
    if bad >= 0:
        raise TriangulationError(int(lines.cell_patch[bad]), "triangles overlap or leave gaps")
    return CellTriangles(triangles, cell)


def _constrained(lines: Linework, cells: IntArray, skeleton: Skeleton) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of cells with lines in them, and the cell of each."""
    if len(cells) == 0:
        return np.empty((0, 3), dtype=np.int32), np.empty(0, dtype=np.int32)
    ring = lines.ring_start[cells + 1] - lines.ring_start[cells]
    vertices = ring + lines.inner_start[cells + 1] - lines.inner_start[cells]
    edges = ring + lines.edge_start[cells + 1] - lines.edge_start[cells]
    vertex_start = np.concatenate([[0], np.cumsum(vertices)])
    edge_start = np.concatenate([[0], np.cumsum(edges)])
    # Where the cells of each patch begin.
    patch = lines.cell_patch[cells]
    first = np.flatnonzero(np.diff(patch, prepend=-1))
    bounds = np.append(first, len(cells))
    place = (np.arange(len(cells)) - np.repeat(first, np.diff(bounds))).astype(np.int32)
    across = np.repeat(np.ceil(np.sqrt(np.diff(bounds))), np.diff(bounds)).astype(np.int32)
    point = np.empty((vertex_start[-1], 2))
    node = np.empty(vertex_start[-1], dtype=np.int32)
    edge = np.empty((edge_start[-1], 2), dtype=np.int32)
    _lay_out(
        cells, patch, place, across, skeleton.center, skeleton.axes, lines.ring_start, lines.ring,
        lines.inner_start, lines.inner, lines.edge_start, lines.edge, lines.node_start, lines.position, point,
        node, edge,
    )  # fmt: skip
    parts = []
    for begin, end in pairwise(bounds.tolist()):
        low, high = int(vertex_start[begin]), int(vertex_start[end])
        within = edge[edge_start[begin] : edge_start[end]] - low
        try:
            parts.append(_library(point[low:high], within) + low)
        except RuntimeError as error:
            raise TriangulationError(int(patch[begin]), str(error)) from error
    found = np.concatenate(parts)
    return node[found], np.repeat(cells, vertices)[found[:, 0]]


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
    cells: IntArray,
    patch: IntArray,
    place: IntArray,
    across: IntArray,
    center: Points,
    axes: FloatArray,
    ring_start: IntArray,
    ring: IntArray,
    inner_start: IntArray,
    inner: IntArray,
    edge_start: IntArray,
    edge: IntArray,
    node_start: IntArray,
    position: Points,
    point: FloatArray,
    node: IntArray,
    edges: IntArray,
) -> None:
    """Points (k, 2) of all cells, each cell in its own square; their nodes (k,), and edges (e, 2) of points.

    They are laid out in their frames, so that Delaunay's criterion is that of the plane but for needles.
    """
    vertex = 0
    line = 0
    for i in range(len(cells)):
        cell = cells[i]
        begin = vertex
        length = ring_start[cell + 1] - ring_start[cell]
        for k in range(length + inner_start[cell + 1] - inner_start[cell]):
            n = ring[ring_start[cell] + k] if k < length else inner[inner_start[cell] + k - length]
            node[vertex] = n
            project(position[node_start[patch[i]] + n], center[cell], axes[cell], point[vertex])
            point[vertex, 0] += _SQUARE * (place[i] % across[i])
            point[vertex, 1] += _SQUARE * (place[i] // across[i])
            vertex += 1
        for k in range(length):
            edges[line, 0] = begin + k
            edges[line, 1] = begin + (k + 1) % length
            line += 1
        for k in range(edge_start[cell], edge_start[cell + 1]):
            edges[line, 0] = begin + edge[k, 0]
            edges[line, 1] = begin + edge[k, 1]
            line += 1
