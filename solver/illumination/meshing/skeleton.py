"""The outlines of cells, cut at every vertex of a neighbour: those of the own patch and those of others.

An outline is a ring of pieces from node to node. Pieces that run along the same place share a rail: the two
sides of an edge inside a patch, and all that meet along a seam between patches. What is added to a rail
later is therefore added to every cell there, and no cell ever has a vertex that its neighbour lacks
([H 3.6], cases A to C).

A rail is as straight as its ends are apart, and places on it are told by the fraction t from its start:
cells are cut along their outlines without any of them ever being moved.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.adjacency import opposite_edges
from solver.illumination.meshing.cells import Cells
from solver.illumination.meshing.seams import find_lines
from solver.illumination.meshing.shared_borders import SharedBorders, share_borders
from solver.illumination.meshing.topology import connect
from solver.kernels import kernel
from solver.transport.subdivision import polygon_area
from solver.types import BoolArray, Corners, FloatArray, IntArray, Points

MINIMUM_LENGTH: Final = 1e-3
"""A piece of a discontinuity shorter than twice this times the width of its cell (area over diameter) is not
meshed: what is as near to a vertex is in it ([H appendix A], 6). Likewise on a rail, of its length."""

_NEEDLE: Final = 8.0
"""Cells are seen as they are up to this ratio of diameter to width; others are seen widened to it."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The outlines of n cells: m pieces between b nodes."""

    position: Points
    """(b, 3) metres"""
    patch: IntArray
    """(b,) patch of each node: patches share none"""
    radius: FloatArray
    """(b,) a constraint edge that comes nearer than this, in metres, runs through the node"""
    start: IntArray
    """(n + 1,) where each cell's pieces begin, at its corner 0"""
    node: IntArray
    """(m,) node at which a piece starts"""
    end: IntArray
    """(m,) node at which it ends"""
    side: IntArray
    """(m,) side 0 to 3 of its cell that it is part of"""
    rail: IntArray
    """(m,) the first of all pieces that run along the same place; its start is where t is 0"""
    owner: IntArray
    """(m,) the first piece of the same patch that runs there"""
    forward: BoolArray
    """(m,) whether a piece runs as its rail does"""
    reach: FloatArray
    """(m,) an end that comes nearer than this to the piece, in metres, is on it; the same along a rail"""
    center: Points
    """(n, 3) mean of the corners of each cell"""
    diameter: FloatArray
    """(n,) length of the longest side or diagonal of each cell, metres"""
    axes: FloatArray
    """(n, 2, 3) metres: a frame for each cell, in which its diameter is about 1 and it is no needle"""
    tolerance: FloatArray
    """(n,) what comes nearer than this within a cell, in its frame, is the same"""

    @property
    def cell_count(self) -> int:
        """Number of cells."""
        return len(self.start) - 1


def build_skeleton(cells: Cells, surfaces: Surfaces) -> Generator[None, None, Skeleton]:
    """The outlines of `cells`; yields every few milliseconds."""
    n = len(cells.patch)
    topology = connect(cells)
    yield
    lines = find_lines(surfaces)
    yield
    borders = share_borders(topology, cells, surfaces, lines)
    yield
    v, s = len(topology.position), len(borders.taken)
    # Nodes inside the edges of cells, edge by edge: of the patch, or of others; no edge has both.
    taken_edge = np.repeat(borders.edge, np.diff(borders.taken_start))
    edge = np.concatenate(
        [np.repeat(np.arange(4 * n, dtype=np.int32), np.diff(topology.inside_start)), taken_edge]
    )
    inside = np.concatenate([topology.inside, np.arange(v, v + s, dtype=np.int32)])
    inside = inside[np.argsort(edge, kind="stable")]
    inside_start = np.zeros(4 * n + 1, dtype=np.int32)
    np.cumsum(np.bincount(edge, minlength=4 * n), out=inside_start[1:])
    patch = np.empty(v, dtype=np.int32)
    patch[topology.vertex] = cells.patch[:, None]

    m = int(cells.corner_count.sum()) + len(inside)
    start, side_start = np.zeros(n + 1, dtype=np.int32), np.empty(4 * n, dtype=np.int32)
    node, end, side = (np.empty(m, dtype=np.int32) for _ in range(3))
    _list_pieces(
        topology.vertex, cells.corner_count, inside_start, inside, start, side_start, node, end, side
    )
    yield
    owner = np.arange(m, dtype=np.int32)
    opposite = opposite_edges(node, end, v + s)
    has_opposite = opposite >= 0
    owner[has_opposite] = np.minimum(owner, opposite)[has_opposite]
    forward = owner == np.arange(m)
    rail = owner.copy()
    _join_seams(borders, side_start, rail, forward)
    yield

    center, along, diameter, width = np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty(n)
    _measure(cells.corners, cells.corner_count, center, along, diameter, width)
    breadth = np.minimum(diameter, _NEEDLE * width)
    across = np.cross(surfaces.normal[cells.patch], along) * (breadth / diameter)[:, None]
    position = np.concatenate([topology.position, borders.position[borders.taken]])
    reach, radius = np.full(m, np.inf), np.full(v + s, np.inf)
    _find_reach(start, node, end, rail, position, MINIMUM_LENGTH * width, reach, radius)
    return Skeleton(
        position=position,
        patch=np.concatenate([patch, cells.patch[taken_edge >> 2]]),
        radius=radius,
        start=start,
        node=node,
        end=end,
        side=side,
        rail=rail,
        owner=owner,
        forward=forward,
        reach=reach,
        center=center,
        diameter=diameter,
        axes=np.stack([along, across], axis=1),
        tolerance=MINIMUM_LENGTH * width / breadth,
    )


def _join_seams(borders: SharedBorders, side_start: IntArray, rail: IntArray, forward: BoolArray) -> None:
    """Give the pieces between the same two places one rail, whatever patches they are of."""
    # The pieces of each edge, and the places between which they run.
    count = np.diff(borders.taken_start) + 1
    ends = np.cumsum(count)
    within = np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - count, count)
    piece = np.repeat(side_start[borders.edge], count) + within
    before = np.empty(len(piece), dtype=np.int64)
    after = np.empty(len(piece), dtype=np.int64)
    is_first, is_last = within == 0, np.zeros(len(piece), dtype=np.bool_)
    is_last[ends - 1] = True
    before[is_first], after[is_last] = borders.first, borders.last
    before[~is_first] = after[~is_last] = borders.taken
    # Smaller than a place is known to nobody else.
    is_long = before != after
    piece, before, after = piece[is_long], before[is_long], after[is_long]
    key = np.minimum(before, after) * len(borders.position) + np.maximum(before, after)
    first, group = np.unique(key, return_index=True, return_inverse=True)[1:]
    rail[piece] = piece[first[group]]
    forward[piece] = before == before[first[group]]


@kernel
def _list_pieces(
    vertex: IntArray,
    count: IntArray,
    inside_start: IntArray,
    inside: IntArray,
    start: IntArray,
    side_start: IntArray,
    node: IntArray,
    end: IntArray,
    side: IntArray,
) -> None:
    at = 0
    for cell in range(len(count)):
        start[cell] = at
        for k in range(count[cell]):
            side_start[4 * cell + k] = at
            node[at] = vertex[cell, k]
            side[at] = k
            at += 1
            for i in range(inside_start[4 * cell + k], inside_start[4 * cell + k + 1]):
                node[at] = inside[i]
                side[at] = k
                at += 1
        for i in range(start[cell], at - 1):
            end[i] = node[i + 1]
        end[at - 1] = node[start[cell]]
    start[len(count)] = at


@kernel
def _measure(
    corners: Corners,
    count: IntArray,
    center: Points,
    along: Points,
    diameter: FloatArray,
    width: FloatArray,
) -> None:
    """Mean corner, longest side or diagonal, its length, and area over that, of each cell."""
    for cell in range(len(count)):
        n = count[cell]
        diameter[cell] = 0.0
        for i in range(n):
            for j in range(i):
                length = 0.0
                for axis in range(3):
                    length += (corners[cell, i, axis] - corners[cell, j, axis]) ** 2
                length = np.sqrt(length)
                if length > diameter[cell]:
                    diameter[cell] = length
                    for axis in range(3):
                        along[cell, axis] = corners[cell, i, axis] - corners[cell, j, axis]
        for axis in range(3):
            center[cell, axis] = 0.0
            for i in range(n):
                center[cell, axis] += corners[cell, i, axis] / n
        width[cell] = polygon_area(corners[cell]) / diameter[cell]


@kernel
def _find_reach(
    start: IntArray,
    node: IntArray,
    end: IntArray,
    rail: IntArray,
    position: Points,
    tolerance: FloatArray,
    reach: FloatArray,
    radius: FloatArray,
) -> None:
    """The reach of pieces is the least that any cell along their rail allows; of nodes, any piece there."""
    for cell in range(len(tolerance)):
        for i in range(start[cell], start[cell + 1]):
            square = 0.0
            for axis in range(3):
                square += (position[end[i], axis] - position[node[i], axis]) ** 2
            allowed = min(tolerance[cell], MINIMUM_LENGTH * np.sqrt(square))
            reach[rail[i]] = min(reach[rail[i]], allowed)
    for i in range(len(node)):
        reach[i] = reach[rail[i]]
        radius[node[i]] = min(radius[node[i]], reach[i])
        radius[end[i]] = min(radius[end[i]], reach[i])
