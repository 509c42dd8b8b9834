"""The kernels of `crossings`: which cells an edge may meet, and where it meets their outlines."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.illumination.meshing.rails import APART
from solver.kernels import inline_kernel, kernel
from solver.types import BoolArray, FloatArray, IntArray, Points

_EXTENT: Final = 0.8
"""Corners are no farther from their mean than 3/4 of the diameter of their cell."""

_OUTSIDE: Final = -1
_INSIDE: Final = -2
"""What `_locate` finds of a point that is on no piece of an outline."""


@kernel
def near_cells(
    first: int,
    last: int,
    edge_patch: IntArray,
    ends: FloatArray,
    cell_start: IntArray,
    center: Points,
    diameter: FloatArray,
) -> IntArray:
    """Pairs (k, 2) of an edge and a cell of its patch that it may meet."""
    pairs, is_near = np.empty((256, 2), np.int32), np.empty(len(center), np.bool_)
    total = 0
    for c in range(first, last):
        px, py, pz = ends[c, 0, 0], ends[c, 0, 1], ends[c, 0, 2]
        dx, dy, dz = ends[c, 1, 0] - px, ends[c, 1, 1] - py, ends[c, 1, 2] - pz
        square = dx * dx + dy * dy + dz * dz
        if square == 0.0:
            continue
        inverse = 1.0 / square
        begin, end = cell_start[edge_patch[c]], cell_start[edge_patch[c] + 1]
        centers = center[begin:end]
        diameters = diameter[begin:end]
        count = 0
        for i in range(len(diameters)):
            x = centers[i, 0] - px
            y = centers[i, 1] - py
            z = centers[i, 2] - pz
            along = min(1.0, max(0.0, (dx * x + dy * y + dz * z) * inverse))
            off = (x - along * dx) ** 2 + (y - along * dy) ** 2 + (z - along * dz) ** 2
            is_near[i] = off <= (_EXTENT * diameters[i]) ** 2
            count += is_near[i]
        # Apart from the search, which runs on vectors then.
        while total + count > len(pairs):
            more = np.empty((2 * len(pairs), 2), np.int32)
            more[:total] = pairs[:total]
            pairs = more
        for i in range(len(diameters)):
            if is_near[i]:
                pairs[total, 0] = c
                pairs[total, 1] = begin + i
                total += 1
    return pairs[:total]


@kernel
def find_stops(
    pairs: IntArray,
    ends: FloatArray,
    patch: IntArray,
    normals: FloatArray,
    start: IntArray,
    node: IntArray,
    end: IntArray,
    rail: IntArray,
    forward: BoolArray,
    position: Points,
    radius: FloatArray,
    reach: FloatArray,
) -> tuple[IntArray, FloatArray]:
    """Stops (k, 4) as cell, constraint, rail or -1, node or end; and the fractions of those on rails (k,)."""
    stops, fraction, where = np.empty((256, 4), np.int32), np.empty(256), np.empty(256)
    total = 0
    for pair in range(len(pairs)):
        c = pairs[pair, 0]
        cell = pairs[pair, 1]
        normal = normals[patch[cell]]
        p = ends[c, 0]
        q = ends[c, 1]
        length = _distance(p, q)
        while total + 2 * (start[cell + 1] - start[cell]) + 2 > len(fraction):
            stops, fraction, where = _grown(stops, fraction, where)
        begin = total
        for i in range(start[cell], start[cell + 1]):
            # Near a node, the edge runs through it.
            x = position[node[i]]
            along = _along(p, q, x)
            if 0.0 <= along <= 1.0 and abs(_turn(p, q, x, normal)) < radius[node[i]] * length:
                where[total] = along
                _put(stops, fraction, total, cell, c, -1, node[i], 0.0)
                total += 1
            # Across a rail, whose ends lie on different sides of the edge.
            a = position[node[rail[i]]]
            b = position[end[rail[i]]]
            left = _turn(p, q, a, normal)
            right = _turn(p, q, b, normal)
            if (left >= 0.0) != (right >= 0.0):
                t = left / (left - right)
                along = _along(p, q, a) + t * (_along(p, q, b) - _along(p, q, a))
                if 0.0 <= along <= 1.0:
                    where[total] = along
                    _put_on_rail(stops, fraction, total, cell, c, i, t, node, end, rail, forward)
                    total += 1
        for k in range(2):
            piece, t = _locate(
                ends[c, k], normal, start[cell], start[cell + 1], node, end, rail, forward, position, radius,
                reach,
            )  # fmt: skip
            if piece == _OUTSIDE:
                continue
            where[total] = float(k)
            if piece == _INSIDE:
                _put(stops, fraction, total, cell, c, -1, -1 - (2 * c + k), 0.0)
            else:
                _put_on_rail(stops, fraction, total, cell, c, piece, t, node, end, rail, forward)
            total += 1
        if total - begin < 2:
            total = begin
        else:
            _sort(where, stops, fraction, begin, total)
    return stops[:total], fraction[:total]


@kernel
def _grown(
    stops: IntArray, fraction: FloatArray, where: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    size = len(fraction)
    more_stops, more_fraction, more_where = (
        np.empty((2 * size, 4), np.int32),
        np.empty(2 * size),
        np.empty(2 * size),
    )
    more_stops[:size] = stops
    more_fraction[:size] = fraction
    more_where[:size] = where
    return more_stops, more_fraction, more_where


@inline_kernel
def _put(
    stops: IntArray, fraction: FloatArray, at: int, cell: int, c: int, rail: int, code: int, t: float
) -> None:
    stops[at, 0] = cell
    stops[at, 1] = c
    stops[at, 2] = rail
    stops[at, 3] = code
    fraction[at] = t


@inline_kernel
def _put_on_rail(
    stops: IntArray,
    fraction: FloatArray,
    at: int,
    cell: int,
    c: int,
    piece: int,
    t: float,
    node: IntArray,
    end: IntArray,
    rail: IntArray,
    forward: BoolArray,
) -> None:
    """Stop at t on the rail of a piece; near one of its ends, at the node there."""
    if APART <= t <= 1.0 - APART:
        _put(stops, fraction, at, cell, c, rail[piece], 0, t)
    else:
        is_start = (t < 0.5) == forward[piece]
        _put(stops, fraction, at, cell, c, -1, node[piece] if is_start else end[piece], 0.0)


@kernel
def _sort(where: FloatArray, stops: IntArray, fraction: FloatArray, begin: int, last: int) -> None:
    """Put the stops of one cell in the order along the edge, by insertion; equals keep theirs."""
    held = np.empty(4, np.int32)
    for i in range(begin + 1, last):
        key = where[i]
        t = fraction[i]
        held[:] = stops[i]
        j = i
        while j > begin and where[j - 1] > key:
            where[j] = where[j - 1]
            fraction[j] = fraction[j - 1]
            stops[j] = stops[j - 1]
            j -= 1
        where[j] = key
        fraction[j] = t
        stops[j] = held


@inline_kernel
def _locate(
    x: FloatArray,
    normal: FloatArray,
    first: int,
    last: int,
    node: IntArray,
    end: IntArray,
    rail: IntArray,
    forward: BoolArray,
    position: Points,
    radius: FloatArray,
    reach: FloatArray,
) -> tuple[int, float]:
    """The piece of an outline that x is on, and where on its rail; or `_INSIDE`, or `_OUTSIDE`."""
    found = _INSIDE
    fraction = 0.0
    nearest = 1.0
    for i in range(first, last):
        # A node takes what is within twice its radius: what is left is that far from all nodes.
        share = _distance(x, position[node[i]]) / (2.0 * radius[node[i]])
        if share < nearest:
            nearest = share
            found = i
            fraction = 0.0 if forward[i] else 1.0
    if found >= 0:
        return found, fraction
    for i in range(first, last):
        a = position[node[rail[i]]]
        b = position[end[rail[i]]]
        height = _turn(a, b, x, normal) / _distance(a, b)
        t = _along(a, b, x)
        if 0.0 <= t <= 1.0 and abs(height) < nearest * reach[i]:
            nearest = abs(height) / reach[i]
            found = i
            fraction = t
        elif found < 0 and (height <= 0.0) == forward[i]:
            found = _OUTSIDE
    return found, fraction


@inline_kernel
def _turn(a: FloatArray, b: FloatArray, x: FloatArray, normal: FloatArray) -> float:
    """Twice the area of the triangle a, b, x (each (3,)): positive if x lies to the left of a -> b."""
    bx = b[0] - a[0]
    by = b[1] - a[1]
    bz = b[2] - a[2]
    ex = x[0] - a[0]
    ey = x[1] - a[1]
    ez = x[2] - a[2]
    return float(
        normal[0] * (by * ez - bz * ey) + normal[1] * (bz * ex - bx * ez) + normal[2] * (bx * ey - by * ex)
    )


@inline_kernel
def _along(a: FloatArray, b: FloatArray, x: FloatArray) -> float:
    """Where x projects to on the line a -> b: 0 at a, 1 at b."""
    product = 0.0
    square = 0.0
    for axis in range(3):
        product += (b[axis] - a[axis]) * (x[axis] - a[axis])
        square += (b[axis] - a[axis]) ** 2
    return product / square


@inline_kernel
def _distance(a: FloatArray, b: FloatArray) -> float:
    """Distance of two points, metres."""
    return float(np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2))
