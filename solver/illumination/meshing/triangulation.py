"""Triangles that tile the cells of patches and have edges along discontinuities ([H 3.6], 5.5.2, 5.5.8).

Triangulations are conforming, in all three cases of [H 3.6]: neighbouring cells share their vertices
whatever their sizes (A), a discontinuity that ends on or crosses an edge is a vertex of both sides (B), and
where borders of patches run along each other all have the same vertices there (C, which [H] leaves open).

The steps, none of them a loop over cells or edges:

1. `skeleton`: the cells' outlines, cut at all vertices of any neighbour; pieces in one place share a rail;
2. `crossings`: where constraint edges meet rails, which get points there, and the chords within cells;
3. `arrangement`: chords in each cell become a plane graph;
4. `linework`: all nodes and edges, numbered patch by patch;
5. `cell_triangles`: triangles of the cells whose part of it is not what it was;
6. `connections`: neighbours, and the discontinuities along edges.

The alternative, to snap all lines of a patch to one grid, moves the edges of cells; here they stay as they
are to the last bit, only discontinuities move, by some thousandths of a cell.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.arrangement import arrange
from solver.illumination.meshing.cell_triangles import CellTriangles, triangulate_cells
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.connections import connect_triangles
from solver.illumination.meshing.crossings import find_chords
from solver.illumination.meshing.linework import Linework, draw_lines
from solver.illumination.meshing.skeleton import build_skeleton
from solver.transport.pace import finish
from solver.types import BoolArray, IntArray, Points


@dataclass(frozen=True, eq=False)
class Triangulation:
    """t triangles over v vertices, both sorted by patch; edge k runs from corner k to the next."""

    position: Points
    """(v, 3) metres; where borders of patches meet, bit-identical but for their own corners' rounding"""
    vertex_patch: IntArray
    """(v,) patches share no vertices"""
    vertex_start: IntArray
    """(p + 1,) where each patch's vertices begin"""
    triangles: IntArray
    """(t, 3) vertices, counter-clockwise from the front; none has no area"""
    triangle_start: IntArray
    """(p + 1,) where each patch's triangles begin"""
    patch: IntArray
    """(t,)"""
    cell: IntArray
    """(t,) cell that a triangle lies in"""
    leaf: IntArray
    """(t,) what that cell is known by"""
    edge_set: IntArray
    """(t, 3) set of discontinuities that an edge lies on, or -1; of several, one with a jump if any has"""
    edge_jump: BoolArray
    """(t, 3) whether irradiance jumps at the edge"""
    neighbour: IntArray
    """(t, 3) triangle of the same patch across an edge, or -1 on the patch's border"""
    rebuilt: int
    """Cells that were triangulated; the others have the triangles of the triangulation before"""
    unresolved: IntArray
    """Cells in which some constraint edges were left out, since their lines did not come to rest"""
    linework: Linework
    """What the triangles follow from"""
    parts: CellTriangles
    """The same triangles, as places in the cells of the linework"""


def triangulate(
    cells: Cells,
    surfaces: Surfaces,
    edges: ConstraintEdges,
    previous: Triangulation | None = None,
    middles: bool = True,
) -> Triangulation:
    """As `triangulate_in_steps`, in one go."""
    return finish(triangulate_in_steps(cells, surfaces, edges, previous, middles))


def triangulate_in_steps(
    cells: Cells,
    surfaces: Surfaces,
    edges: ConstraintEdges,
    previous: Triangulation | None = None,
    middles: bool = True,
) -> Generator[None, None, Triangulation]:
    """Triangles that tile `cells`, with edges along all `edges`; yields every few milliseconds.

    What of an edge is nearer than `skeleton.MINIMUM_LENGTH`, times the width of the cell, to a vertex or to
    an edge of cells is moved there. A cell that is as it was in `previous`, whatever its number there, with
    all vertices on its outline and all lines within it, keeps its triangles, in their order: the same that
    it would get anew. With `middles`, a cell that several smaller neighbours touch gets a vertex in its
    middle: more triangles, but fewer that are long and thin.

    Raises ValueError for edges that are not finite or not on a patch, TriangulationError where triangles do
    not tile their cell.
    """
    p = surfaces.patch_count
    if not np.all((edges.patch >= 0) & (edges.patch < p)):
        raise ValueError(f"constraint edges must lie on patches 0 to {p - 1}")
    if not np.all(np.isfinite(edges.ends)):
        raise ValueError("constraint edges must have finite ends")
    order = np.argsort(cells.patch, kind="stable").astype(np.int32)
    cells = Cells(cells.corners[order], cells.corner_count[order], cells.patch[order], cells.leaf[order])
    edges = edges.take(np.argsort(~edges.jump, kind="stable").astype(np.int32))
    yield
    skeleton = yield from build_skeleton(cells, surfaces)
    yield
    chords, points = yield from find_chords(cells, surfaces, edges, skeleton)
    yield
    arrangement, rings = yield from arrange(chords, points, edges, skeleton)
    yield
    lines = yield from draw_lines(cells, surfaces, edges, skeleton, rings, arrangement, middles)
    yield
    before = (None, None) if previous is None else (previous.linework, previous.parts)
    parts, fresh = yield from triangulate_cells(lines, *before)
    yield
    triangles = parts.nodes(lines)
    triangle_start = parts.start[lines.cell_start]
    connections = yield from connect_triangles(triangles, triangle_start, lines)
    cell = np.repeat(np.arange(len(order)), np.diff(parts.start))
    return Triangulation(
        position=lines.position,
        vertex_patch=np.repeat(np.arange(p, dtype=np.int32), np.diff(lines.node_start)),
        vertex_start=lines.node_start,
        triangles=triangles,
        triangle_start=triangle_start,
        patch=cells.patch[cell],
        cell=order[cell],
        leaf=cells.leaf[cell],
        edge_set=connections.edge_set,
        edge_jump=connections.edge_jump,
        neighbour=connections.neighbour,
        rebuilt=len(fresh),
        unresolved=order[np.unique(arrangement.dropped)],
        linework=lines,
        parts=parts,
    )
