"""How leaves hang together: shared vertices, opposite edges, vertices inside edges.

A leaf's neighbours may be smaller than itself. Their corners on its edge are T-vertices: drawn as they
are, they leave cracks, since a rasteriser rounds them off the edge. Here each edge is told which
vertices lie inside it, so that the larger leaf can take them into its outline.

Vertices are shared within a patch where they are bit-identical, which neighbours in a subdivision are.
An edge without an opposite edge is open: it lies on the border of its patch, or it faces smaller
leaves. The second kind is found by walking back from the edge's end to its start over open edges that
run straight against it. No tolerance decides who is neighbour to whom, only which way is straight on but for
rounding, so any number of extra vertices, at any difference in size, is found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.illumination.meshing.cells import Leaves
from solver.kernels import inline_kernel, kernel
from solver.types import BoolArray, Int64Array, IntArray, Points

_STRAIGHT: Final = 2.0**-40
"""A vertex is on an edge if its distance from the edge is at most this times the greatest coordinate: what
rounding makes of a middle, thousands of times over, and less than the width of the thinnest needle."""

HASH: Final = -7046029254386353131
"""2^64 over the golden ratio, odd, as a signed number: Fibonacci hashing."""


@dataclass(frozen=True, eq=False)
class Topology:
    """Connections of n leaves with v vertices. Edge 4 l + k runs from corner k of leaf l to the next."""

    vertex: IntArray
    """(n, 4) vertex of each corner; a triangle repeats its last"""
    position: Points
    """(v, 3) metres"""
    leaf_start: IntArray
    """(v + 1,) where each vertex's part of `leaf_edge` begins"""
    leaf_edge: IntArray
    """Edges that leave a vertex, vertex by vertex: edge >> 2 are the leaves that have it as a corner"""
    hanging_on: IntArray
    """(v,) the leaf that has the vertex inside one of its edges, or -1"""
    inside_start: IntArray
    """(4 n + 1,) where each edge's part of `inside` begins"""
    inside: IntArray
    """Vertices strictly inside an edge, edge by edge, from its start to its end"""
    border: IntArray
    """Edges on the border of their patch, ascending"""


def connect(leaves: Leaves) -> Topology:
    """The connections of `leaves`."""
    n = len(leaves.patch)
    count = leaves.corner_count
    # Adding 0 makes -0 into 0, which have different bits.
    corners = np.ascontiguousarray(leaves.corners + 0.0)
    vertex = np.empty((n, 4), dtype=np.int32)
    source = np.empty(4 * n, dtype=np.int32)
    table = np.full(table_size(4 * n), -1, dtype=np.int32)
    bits = corners.view(np.int64)
    v = _weld(bits, count, leaves.patch, vertex, source, table)
    position = corners.reshape(-1, 3)[source[:v]]
    leaf_start, leaf_edge = np.zeros(v + 1, dtype=np.int32), np.empty(int(count.sum()), dtype=np.int32)
    end = np.empty(4 * n, dtype=np.int32)
    _list_edges(vertex, count, leaf_start, leaf_edge, end)
    is_open = np.zeros(4 * n, dtype=np.bool_)
    opened = _find_open(vertex, count, leaf_start, leaf_edge, end, is_open)
    inside_start = np.zeros(4 * n + 1, dtype=np.int32)
    inside = np.empty(opened, dtype=np.int32)
    hanging_on = np.full(v, -1, dtype=np.int32)
    off = _STRAIGHT * np.abs(position).max(initial=0.0)
    total = _walk(
        vertex, end, position, off, leaf_start, leaf_edge, is_open, inside_start, inside, hanging_on
    )
    return Topology(
        vertex=vertex,
        position=position,
        leaf_start=leaf_start,
        leaf_edge=leaf_edge,
        hanging_on=hanging_on,
        inside_start=inside_start,
        inside=inside[:total],
        border=np.flatnonzero(is_open).astype(np.int32),
    )


def table_size(entries: int) -> int:
    """A power of two that leaves a hash table at least half empty."""
    return 1 << max(2 * entries - 1, 1).bit_length()


@kernel
def _weld(
    bits: Int64Array, count: IntArray, patch: IntArray, vertex: IntArray, source: IntArray, table: IntArray
) -> int:
    """Number the corners (n, 4, 3), as bits, of each patch; returns the number of vertices.

    `source` receives the corner 4 l + k that first had each vertex. `table` is open-addressed.
    """
    mask = len(table) - 1
    found = 0
    for leaf in range(len(count)):
        for k in range(count[leaf]):
            x = bits[leaf, k, 0]
            y = bits[leaf, k, 1]
            z = bits[leaf, k, 2]
            h = (x ^ patch[leaf]) * HASH
            h = ((h ^ (h >> 32)) + y) * HASH
            h = ((h ^ (h >> 32)) + z) * HASH
            place = (h >> 24) & mask
            while True:
                known = table[place]
                if known < 0:
                    table[place] = found
                    source[found] = 4 * leaf + k
                    vertex[leaf, k] = found
                    found += 1
                    break
                other = source[known] >> 2
                slot = source[known] & 3
                if (
                    bits[other, slot, 0] == x
                    and bits[other, slot, 1] == y
                    and bits[other, slot, 2] == z
                    and patch[other] == patch[leaf]
                ):
                    vertex[leaf, k] = known
                    break
                place = (place + 1) & mask
        if count[leaf] == 3:
            vertex[leaf, 3] = vertex[leaf, 2]
    return found


@kernel
def _list_edges(vertex: IntArray, count: IntArray, start: IntArray, edges: IntArray, end: IntArray) -> None:
    """List the edges that leave each vertex, by a counting sort, and the vertex at the end of each edge."""
    for leaf in range(len(count)):
        for k in range(count[leaf]):
            start[vertex[leaf, k] + 1] += 1
            end[4 * leaf + k] = vertex[leaf, k + 1 if k + 1 < count[leaf] else 0]
        if count[leaf] == 3:
            end[4 * leaf + 3] = -1
    for v in range(len(start) - 1):
        start[v + 1] += start[v]
    # Moved on by one, each start is the place of the next edge, and after the last edge the end of its part.
    for v in range(len(start) - 1, 0, -1):
        start[v] = start[v - 1]
    for leaf in range(len(count)):
        for k in range(count[leaf]):
            v = vertex[leaf, k]
            edges[start[v + 1]] = 4 * leaf + k
            start[v + 1] += 1


@kernel
def _find_open(
    vertex: IntArray, count: IntArray, start: IntArray, edges: IntArray, end: IntArray, is_open: BoolArray
) -> int:
    """Mark the edges that no edge opposes; returns how many."""
    total = 0
    for leaf in range(len(count)):
        for k in range(count[leaf]):
            a = vertex[leaf, k]
            b = end[4 * leaf + k]
            i = start[b]
            while i < start[b + 1] and end[edges[i]] != a:
                i += 1
            if i == start[b + 1]:
                is_open[4 * leaf + k] = True
                total += 1
    return total


@kernel
def _walk(
    vertex: IntArray,
    end: IntArray,
    position: Points,
    off: float,
    start: IntArray,
    edges: IntArray,
    is_open: BoolArray,
    inside_start: IntArray,
    inside: IntArray,
    hanging_on: IntArray,
) -> int:
    """Find the vertices inside each open edge; returns how many. Edges on either side cease to be open.

    What stays open is on the border of its patch.
    """
    total = 0
    steps = np.empty(len(inside) + 1, dtype=np.int32)
    for edge in range(len(end)):
        inside_start[edge] = total
        if not is_open[edge]:
            continue
        # Step from the edge's end towards its start, along open edges that run straight back.
        goal = vertex[edge >> 2, edge & 3]
        at = end[edge]
        taken = 0
        while at != goal:
            onward = _straight_on(position, off, start, edges, end, is_open, at, goal)
            if onward < 0:
                break
            steps[taken] = onward
            taken += 1
            at = end[onward]
        if at != goal:
            continue
        # The walk closed: what it met lies inside this edge, last met first.
        is_open[edge] = False
        for i in range(taken):
            is_open[steps[i]] = False
        for i in range(taken - 1, 0, -1):
            met = vertex[steps[i] >> 2, steps[i] & 3]
            inside[total] = met
            hanging_on[met] = edge >> 2
            total += 1
    inside_start[len(end)] = total
    return total


@inline_kernel
def _straight_on(
    position: Points,
    off: float,
    start: IntArray,
    edges: IntArray,
    end: IntArray,
    is_open: BoolArray,
    at: int,
    goal: int,
) -> int:
    """The open edge that leaves `at` towards `goal`, no more than `off` beside it nor beyond it, or -1."""
    dx = position[goal, 0] - position[at, 0]
    dy = position[goal, 1] - position[at, 1]
    dz = position[goal, 2] - position[at, 2]
    reach = dx * dx + dy * dy + dz * dz
    for i in range(start[at], start[at + 1]):
        edge = edges[i]
        if not is_open[edge]:
            continue
        to = end[edge]
        ex = position[to, 0] - position[at, 0]
        ey = position[to, 1] - position[at, 1]
        ez = position[to, 2] - position[at, 2]
        length = ex * ex + ey * ey + ez * ez
        cx = dy * ez - dz * ey
        cy = dz * ex - dx * ez
        cz = dx * ey - dy * ex
        ahead = dx * ex + dy * ey + dz * ez
        is_straight = cx * cx + cy * cy + cz * cz <= off * off * reach
        if is_straight and ahead > 0.0 and (to == goal or length < reach):
            return int(edge)
    return -1
