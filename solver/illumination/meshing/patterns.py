"""Triangles of cells without lines in them, by pattern.

A cell of corners alone is cut along its better diagonal, one with a single node inside its sides is a fan
from that node, and one with a node in its middle a fan from there.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.illumination.meshing.linework import Linework
from solver.kernels import inline_kernel, kernel
from solver.types import IntArray, Points

_STRAIGHT: Final = 1e-6
"""A node of a ring is no corner if the sine of its angle is at most this."""

_EQUAL: Final = 1e-9
"""A diagonal is the worse one if the sine of the angles that face it says so by more than this."""

_NONE: Final = -1


def pattern_triangles(lines: Linework, cells: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Triangles (t, 3) of those of `cells` that have a pattern, in nodes from their patch's first.

    Returns them, the cell of each, and the cells that have no pattern.
    """
    patch = lines.cell_patch[cells]
    count = np.empty(len(cells), dtype=np.int32)
    _count_patterns(
        cells, patch, lines.corner_count, lines.ring_start, lines.inner_start, lines.edge_start, lines.ring,
        lines.node_start, lines.position, count,
    )  # fmt: skip
    chosen = count != _NONE
    simple, count = cells[chosen], count[chosen]
    triangles = np.empty((int(count.sum()), 3), dtype=np.int32)
    _fill_patterns(
        simple, patch[chosen], lines.corner_count, lines.ring_start, lines.inner_start, lines.ring,
        lines.inner, lines.node_start, lines.position, triangles,
    )  # fmt: skip
    return triangles, np.repeat(simple, count), cells[~chosen]


@kernel
def _count_patterns(
    cells: IntArray,
    patch: IntArray,
    corner_count: IntArray,
    ring_start: IntArray,
    inner_start: IntArray,
    edge_start: IntArray,
    ring: IntArray,
    node_start: IntArray,
    position: Points,
    count: IntArray,
) -> None:
    """How many triangles the pattern of each cell has; `_NONE` for a cell without one."""
    for i in range(len(cells)):
        cell = cells[i]
        length = ring_start[cell + 1] - ring_start[cell]
        inner = inner_start[cell + 1] - inner_start[cell]
        count[i] = _NONE
        if edge_start[cell + 1] > edge_start[cell]:
            continue
        if inner == 1:
            count[i] = length
        elif length == corner_count[cell] or (
            length == corner_count[cell] + 1
            and _straight_corners(ring, ring_start[cell], length, node_start[patch[i]], position) == 1
        ):
            count[i] = length - 2


@kernel
def _straight_corners(ring: IntArray, start: int, length: int, first: int, position: Points) -> int:
    """How many nodes of a ring are no corners."""
    found = 0
    for k in range(length):
        a = first + ring[start + (k + length - 1) % length]
        b = first + ring[start + k]
        c = first + ring[start + (k + 1) % length]
        sine, _ = _angle(position, a, b, c)
        if sine <= _STRAIGHT:
            found += 1
    return found


@inline_kernel
def _angle(position: Points, a: int, b: int, c: int) -> tuple[float, float]:
    """Sine and cosine of the angle at b between a and c."""
    ux = position[a, 0] - position[b, 0]
    uy = position[a, 1] - position[b, 1]
    uz = position[a, 2] - position[b, 2]
    vx = position[c, 0] - position[b, 0]
    vy = position[c, 1] - position[b, 1]
    vz = position[c, 2] - position[b, 2]
    x = uy * vz - uz * vy
    y = uz * vx - ux * vz
    z = ux * vy - uy * vx
    size = np.sqrt((ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz))
    return np.sqrt(x * x + y * y + z * z) / size, (ux * vx + uy * vy + uz * vz) / size


@kernel
def _fill_patterns(
    cells: IntArray,
    patch: IntArray,
    corner_count: IntArray,
    ring_start: IntArray,
    inner_start: IntArray,
    ring: IntArray,
    inner: IntArray,
    node_start: IntArray,
    position: Points,
    triangles: IntArray,
) -> None:
    at = 0
    for i in range(len(cells)):
        cell = cells[i]
        start = ring_start[cell]
        length = ring_start[cell + 1] - start
        first = node_start[patch[i]]
        if inner_start[cell + 1] > inner_start[cell]:
            # A fan from the middle.
            for k in range(length):
                triangles[at, 0] = inner[inner_start[cell]]
                triangles[at, 1] = ring[start + k]
                triangles[at, 2] = ring[start + (k + 1) % length]
                at += 1
            continue
        # A fan from the node inside a side, or from an end of the better diagonal.
        apex = 0
        if length > corner_count[cell]:
            least = np.inf
            for k in range(length):
                sine, _ = _angle(
                    position,
                    first + ring[start + (k + length - 1) % length],
                    first + ring[start + k],
                    first + ring[start + (k + 1) % length],
                )
                if sine < least:
                    least = sine
                    apex = k
        elif length == 4:
            a = first + ring[start]
            b = first + ring[start + 1]
            c = first + ring[start + 2]
            d = first + ring[start + 3]
            sine_b, cosine_b = _angle(position, a, b, c)
            sine_d, cosine_d = _angle(position, c, d, a)
            if sine_b * cosine_d + cosine_b * sine_d < -_EQUAL:
                apex = 1
        for k in range(1, length - 1):
            triangles[at, 0] = ring[start + apex]
            triangles[at, 1] = ring[start + (apex + k) % length]
            triangles[at, 2] = ring[start + (apex + k + 1) % length]
            at += 1
