"""Triangles of cells without lines in them, by pattern.

A cell of corners alone is cut along its better diagonal, one with a single node inside its sides is a fan
from that node, and one with a node in its middle a fan from there.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.illumination.meshing.cell_lines import CellLines
from solver.kernels import inline_kernel, kernel
from solver.types import Int64Array, IntArray, Points

_STRAIGHT: Final = 1e-6
"""A node of a ring is no corner if the sine of its angle is at most this."""

_EQUAL: Final = 1e-9
"""A diagonal is the worse one if the sine of the angles that face it says so by more than this."""

_NONE: Final = -1


def pattern_triangles(lines: CellLines) -> tuple[IntArray, Int64Array, Int64Array]:
    """Triangles (t, 3), in places, of those of `lines` that have a pattern.

    Returns them, the cell of each, and the cells that have no pattern; both ascend.
    """
    count = np.empty(len(lines), dtype=np.int32)
    _count_patterns(
        lines.corner_count, lines.ring_length, lines.start, lines.edge_start, lines.position, count
    )
    simple, left = np.flatnonzero(count != _NONE), np.flatnonzero(count == _NONE)
    count = count[simple]
    triangles = np.empty((int(count.sum()), 3), dtype=np.int32)
    _fill_patterns(simple, lines.corner_count, lines.ring_length, lines.start, lines.position, triangles)
    return triangles, np.repeat(simple, count), left


@kernel
def _count_patterns(
    corner_count: IntArray,
    ring_length: IntArray,
    start: IntArray,
    edge_start: IntArray,
    position: Points,
    count: IntArray,
) -> None:
    """How many triangles the pattern of each cell has; `_NONE` for a cell without one."""
    for cell in range(len(count)):
        length = ring_length[cell]
        inner = start[cell + 1] - start[cell] - length
        count[cell] = _NONE
        if edge_start[cell + 1] > edge_start[cell]:
            continue
        if inner == 1:
            count[cell] = length
        elif length == corner_count[cell] or (
            length == corner_count[cell] + 1 and _straight_corners(start[cell], length, position) == 1
        ):
            count[cell] = length - 2


@kernel
def _straight_corners(start: int, length: int, position: Points) -> int:
    """How many nodes of a ring are no corners."""
    found = 0
    for k in range(length):
        sine, _ = _angle(position, start + (k + length - 1) % length, start + k, start + (k + 1) % length)
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
    cells: Int64Array,
    corner_count: IntArray,
    ring_length: IntArray,
    start: IntArray,
    position: Points,
    triangles: IntArray,
) -> None:
    at = 0
    for cell in cells:
        first = start[cell]
        length = ring_length[cell]
        if start[cell + 1] - first > length:
            # A fan from the middle.
            for k in range(length):
                triangles[at, 0] = length
                triangles[at, 1] = k
                triangles[at, 2] = (k + 1) % length
                at += 1
            continue
        # A fan from the node inside a side, or from an end of the better diagonal.
        apex = 0
        if length > corner_count[cell]:
            least = np.inf
            for k in range(length):
                before, after = (k + length - 1) % length, (k + 1) % length
                sine, _ = _angle(position, first + before, first + k, first + after)
                if sine < least:
                    least = sine
                    apex = k
        elif length == 4:
            sine_b, cosine_b = _angle(position, first, first + 1, first + 2)
            sine_d, cosine_d = _angle(position, first + 2, first + 3, first)
            if sine_b * cosine_d + cosine_b * sine_d < -_EQUAL:
                apex = 1
        for k in range(1, length - 1):
            triangles[at, 0] = apex
            triangles[at, 1] = (apex + k) % length
            triangles[at, 2] = (apex + k + 1) % length
            at += 1
