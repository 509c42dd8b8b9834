"""Triangles that must tile their cells: those that only rounding keeps from being flat, and the check.

Of vertices on one line, rounding decides on which side of it each lies. A triangle of three such vertices
is right side up where it was made and may not be so in space. Its longest edge gives way to the other
diagonal, unless a line runs there, which no line does that near to a vertex.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.illumination.meshing.cell_lines import CellLines
from solver.kernels import inline_kernel, kernel
from solver.types import FloatArray, IntArray, Points

_ROUNDING: Final = 2.0**-40
"""A height may be rounding if it is at most this times the coordinates: thousands of their last digits."""

_TURNS: Final = 4
"""Times that a triangle of a cell is turned, on average, before it is taken as it is."""

_SURE: Final = 1e6
"""Areas are certain in cells that are wider than this times what may be rounding."""

_AREA: Final = 1e-9
"""The areas of triangles may miss that of their cell by this part of it."""


def settle_tiling(lines: CellLines, first: IntArray, triangles: IntArray) -> int:
    """Turn flat pairs of `triangles` (t, 3), in places, so that they tile the cells `lines`.

    Those of each cell begin at `first` (c + 1,). Returns a cell that is not tiled by triangles that are all
    counter-clockwise, or -1.
    """
    return int(
        _settle(
            first, triangles, lines.ring_length, lines.start, lines.edge_start, lines.edge, lines.position,
            lines.normal,
        )
    )  # fmt: skip


@kernel
def _settle(
    first: IntArray,
    triangles: IntArray,
    ring_length: IntArray,
    start: IntArray,
    edge_start: IntArray,
    edge: IntArray,
    position: Points,
    normals: Points,
) -> int:
    for cell in range(len(ring_length)):
        normal = normals[cell]
        x = position[start[cell] : start[cell + 1]]
        count = ring_length[cell]
        whole = 0.0
        span = 0.0
        largest = 0.0
        for k in range(count):
            for axis in range(3):
                largest = max(largest, abs(x[k, axis]))
            span = max(span, _distance(x, 0, k))
            if k > 0 and k + 1 < count:
                whole += _area(x, 0, k, k + 1, normal)
        flat = _ROUNDING * largest
        # Each turn makes the lesser height of two triangles greater; where all is rounding, patience ends it.
        fixed = edge[edge_start[cell] : edge_start[cell + 1]]
        begin, end = first[cell], first[cell + 1]
        t = begin
        turns = _TURNS * (end - begin)
        while t < end:
            turned = turns > 0 and _turn(triangles, fixed, t, begin, end, x, normal, flat)
            turns -= turned
            t = begin if turned else t + 1
        # In the thinnest of needles, rounding decides which area there is.
        doubt = flat * span
        if whole > _SURE * doubt:
            doubt = 0.0
        total = 0.0
        for t in range(begin, end):
            area = _area(x, triangles[t, 0], triangles[t, 1], triangles[t, 2], normal)
            if not (area > 0.0 or area > -doubt):
                return cell
            total += area
        if not abs(total - whole) <= _AREA * whole + doubt * (end - begin):
            return cell
    return -1


@kernel
def _turn(
    triangles: IntArray,
    fixed: IntArray,
    t: int,
    first: int,
    last: int,
    position: Points,
    normal: FloatArray,
    flat: float,
) -> bool:
    """Give a triangle lower than `flat` and that along its longest edge their other diagonal, if better."""
    longest = 0.0
    k = 0
    for i in range(3):
        length = _distance(position, triangles[t, i], triangles[t, (i + 1) % 3])
        if length > longest:
            longest = length
            k = i
    a = triangles[t, k]
    b = triangles[t, (k + 1) % 3]
    c = triangles[t, (k + 2) % 3]
    height = _height(position, a, b, c, normal)
    if height > flat:
        return False
    for e in range(len(fixed)):
        if (fixed[e, 0] == a and fixed[e, 1] == b) or (fixed[e, 0] == b and fixed[e, 1] == a):
            return False
    for u in range(first, last):
        for i in range(3):
            if triangles[u, i] == b and triangles[u, (i + 1) % 3] == a:
                d = triangles[u, (i + 2) % 3]
                one = _height(position, a, d, c, normal)
                other = _height(position, d, b, c, normal)
                lesser = min(height, _height(position, b, a, d, normal))
                if not min(one, other) > lesser:
                    return False
                triangles[t, 0], triangles[t, 1], triangles[t, 2] = a, d, c
                triangles[u, 0], triangles[u, 1], triangles[u, 2] = d, b, c
                return True
    return False


@inline_kernel
def _distance(position: Points, a: int, b: int) -> float:
    square = 0.0
    for axis in range(3):
        square += (position[b, axis] - position[a, axis]) ** 2
    return float(np.sqrt(square))


@inline_kernel
def _height(position: Points, a: int, b: int, c: int, normal: FloatArray) -> float:
    """Height of a triangle over its longest edge; negative if it is clockwise."""
    longest = max(_distance(position, a, b), _distance(position, b, c), _distance(position, c, a))
    return 2.0 * _area(position, a, b, c, normal) / longest


@inline_kernel
def _area(position: Points, a: int, b: int, c: int, normal: FloatArray) -> float:
    """Area of a triangle as seen from the front."""
    ux = position[b, 0] - position[a, 0]
    uy = position[b, 1] - position[a, 1]
    uz = position[b, 2] - position[a, 2]
    vx = position[c, 0] - position[a, 0]
    vy = position[c, 1] - position[a, 1]
    vz = position[c, 2] - position[a, 2]
    return 0.5 * float(
        normal[0] * (uy * vz - uz * vy) + normal[1] * (uz * vx - ux * vz) + normal[2] * (ux * vy - uy * vx)
    )
