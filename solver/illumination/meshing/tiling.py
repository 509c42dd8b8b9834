"""Triangles that must tile their cells: those that only rounding keeps from being flat, and the check.

Of vertices on one line, rounding decides on which side of it each lies. A triangle of three such vertices
is right side up where it was made and may not be so in space. Its longest edge gives way to the other
diagonal, unless a line runs there, which no line does that near to a vertex.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.illumination.meshing.linework import Linework
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


def settle_tiling(
    lines: Linework, cells: IntArray, triangles: IntArray, cell: IntArray, normals: FloatArray
) -> int:
    """Turn flat pairs of `triangles` (t, 3), sorted by `cell` (t,), so that they tile `cells`.

    Normals (p, 3) are of the patches. Returns a cell that is not tiled by triangles that are all
    counter-clockwise, or -1.
    """
    first = np.searchsorted(cell, cells).astype(np.int32)
    last = np.searchsorted(cell, cells, side="right").astype(np.int32)
    return int(
        _settle(
            cells, lines.cell_patch[cells], first, last, triangles, lines.ring_start, lines.ring,
            lines.inner_start, lines.inner, lines.edge_start, lines.edge, lines.node_start, lines.position,
            normals,
        )
    )  # fmt: skip


@kernel
def _settle(
    cells: IntArray,
    patch: IntArray,
    first: IntArray,
    last: IntArray,
    triangles: IntArray,
    ring_start: IntArray,
    ring: IntArray,
    inner_start: IntArray,
    inner: IntArray,
    edge_start: IntArray,
    edge: IntArray,
    node_start: IntArray,
    position: Points,
    normals: FloatArray,
) -> int:
    for i in range(len(cells)):
        normal = normals[patch[i]]
        base = node_start[patch[i]]
        start = ring_start[cells[i]]
        whole = 0.0
        span = 0.0
        largest = 0.0
        for k in range(start, ring_start[cells[i] + 1]):
            for axis in range(3):
                largest = max(largest, abs(position[base + ring[k], axis]))
            span = max(span, _distance(position, base + ring[start], base + ring[k]))
            if k > start and k + 1 < ring_start[cells[i] + 1]:
                whole += _area(position, base + ring[start], base + ring[k], base + ring[k + 1], normal)
        flat = _ROUNDING * largest
        # What the lines of the cell run between.
        count = ring_start[cells[i] + 1] - start
        fixed = np.empty((edge_start[cells[i] + 1] - edge_start[cells[i]], 2), np.int32)
        for e in range(len(fixed)):
            for k in range(2):
                place = edge[edge_start[cells[i]] + e, k]
                fixed[e, k] = (
                    ring[start + place] if place < count else inner[inner_start[cells[i]] + place - count]
                )
        # Each turn makes the lesser height of two triangles greater; where all is rounding, patience ends it.
        t = first[i]
        turns = _TURNS * (last[i] - first[i])
        while t < last[i]:
            turned = turns > 0 and _turn(triangles, fixed, t, first[i], last[i], base, position, normal, flat)
            turns -= turned
            t = first[i] if turned else t + 1
        # In the thinnest of needles, rounding decides which area there is.
        doubt = flat * span
        if whole > _SURE * doubt:
            doubt = 0.0
        total = 0.0
        for t in range(first[i], last[i]):
            area = _area(
                position, base + triangles[t, 0], base + triangles[t, 1], base + triangles[t, 2], normal
            )
            if not (area > 0.0 or area > -doubt):
                return int(cells[i])
            total += area
        if not abs(total - whole) <= _AREA * whole + doubt * (last[i] - first[i]):
            return int(cells[i])
    return -1


@kernel
def _turn(
    triangles: IntArray,
    fixed: IntArray,
    t: int,
    first: int,
    last: int,
    base: int,
    position: Points,
    normal: FloatArray,
    flat: float,
) -> bool:
    """Give a triangle lower than `flat` and that along its longest edge their other diagonal, if better."""
    longest = 0.0
    k = 0
    for i in range(3):
        length = _distance(position, base + triangles[t, i], base + triangles[t, (i + 1) % 3])
        if length > longest:
            longest = length
            k = i
    a = triangles[t, k]
    b = triangles[t, (k + 1) % 3]
    c = triangles[t, (k + 2) % 3]
    height = _height(position, base + a, base + b, base + c, normal)
    if height > flat:
        return False
    for e in range(len(fixed)):
        if (fixed[e, 0] == a and fixed[e, 1] == b) or (fixed[e, 0] == b and fixed[e, 1] == a):
            return False
    for u in range(first, last):
        for i in range(3):
            if triangles[u, i] == b and triangles[u, (i + 1) % 3] == a:
                d = triangles[u, (i + 2) % 3]
                one = _height(position, base + a, base + d, base + c, normal)
                other = _height(position, base + d, base + b, base + c, normal)
                lesser = min(height, _height(position, base + b, base + a, base + d, normal))
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
