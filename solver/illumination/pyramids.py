"""What a convex blocker hides from a point: the inside of a pyramid, beyond the blocker's plane ([H 6.2]).

Places are taken from the point, so that the pyramid's sides have no offset: a place is hidden if it is above
all sides, and beyond the plane.

Kernels here and in `visible_parts` take whole arrays with the row that is meant, and have one exit: views of
rows, and returns from within, have numba count references at every call, which took more than half the time.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from solver.kernels import kernel
from solver.types import Corners, FloatArray, Int64Array, IntArray

NORMAL: Final = 12
DISTANCE: Final = 15
PYRAMID: Final = 16
"""Columns of a pyramid's row: unit normals of four sides, inside above; the plane's unit normal away from the
point; its distance in metres, 0 where the point is on it and nothing is hidden."""

CLEAR: Final = -1
PLANE: Final = 16
"""What a pyramid does to a polygon: nothing; cut it by its plane."""

HIDDEN: Final = -1
"""In place of a number of blockers: one of them hides all there is."""

SLIVER: Final = 1e-14
"""What reaches past a side by less than this angle does not: so much may rounding make of an edge that two
blockers, or blocker and source, have in common."""


@kernel
def raise_pyramid(
    x: FloatArray,
    corners: Corners,
    polygon: int,
    count: int,
    normals: FloatArray,
    plane: int,
    tolerance: float,
    pyramids: FloatArray,
    row: int,
) -> None:
    """Fill a row of pyramids (p, PYRAMID) with what a polygon hides from a point x (3,).

    The polygon is a row of corners (b, 4, 3), its unit normal the row `plane` of normals (n, 3). A point
    within `tolerance` metres of its plane is on it.
    """
    distance = 0.0
    for axis in range(3):
        distance += normals[plane, axis] * (corners[polygon, 0, axis] - x[axis])
    if abs(distance) <= tolerance:
        pyramids[row, DISTANCE] = 0.0
    else:
        sign = 1.0 if distance > 0.0 else -1.0
        for axis in range(3):
            pyramids[row, NORMAL + axis] = sign * normals[plane, axis]
        pyramids[row, DISTANCE] = sign * distance
        last = count - 1
        for k in range(count):
            ax = corners[polygon, last, 0] - x[0]
            ay = corners[polygon, last, 1] - x[1]
            az = corners[polygon, last, 2] - x[2]
            # Not from corner to corner: the cross product would lose the digits of what is small or far off.
            ex = corners[polygon, k, 0] - corners[polygon, last, 0]
            ey = corners[polygon, k, 1] - corners[polygon, last, 1]
            ez = corners[polygon, k, 2] - corners[polygon, last, 2]
            sx = ay * ez - az * ey
            sy = az * ex - ax * ez
            sz = ax * ey - ay * ex
            length = math.sqrt(sx * sx + sy * sy + sz * sz)
            if length > 0.0:
                pyramids[row, 3 * k] = sign * sx / length
                pyramids[row, 3 * k + 1] = sign * sy / length
                pyramids[row, 3 * k + 2] = sign * sz / length
            else:
                # An edge without length cuts nothing: all that is beyond the plane is above it.
                for axis in range(3):
                    pyramids[row, 3 * k + axis] = pyramids[row, NORMAL + axis]
            last = k


@kernel
def sliver_of(polygons: FloatArray, slot: int, count: int) -> float:
    """Metres by which a polygon may reach past a side and does not: a row of polygons (s, n, 3)."""
    square = 0.0
    for k in range(count):
        here = 0.0
        for axis in range(3):
            here += polygons[slot, k, axis] * polygons[slot, k, axis]
        square = max(square, here)
    return SLIVER * math.sqrt(square)


@kernel
def sides_cut(
    polygons: FloatArray,
    slot: int,
    count: int,
    pyramids: FloatArray,
    row: int,
    sides: int,
    tolerance: float,
    sliver: float,
) -> int:
    """By which planes of a pyramid a row of polygons (s, n, 3) relative to the point is cut: a bit for each.

    Bits 0 to 3 are the sides, PLANE the blocker's own. 0 if all of the polygon is hidden, CLEAR if all of it
    is before the blocker or outside one side. `tolerance` is that of the plane, `sliver` that of the sides.
    """
    cut = CLEAR
    if pyramids[row, DISTANCE] > 0.0:
        cut = 0
        side = -1
        while side < sides and cut != CLEAR:
            at = NORMAL if side < 0 else 3 * side
            offset = pyramids[row, DISTANCE] if side < 0 else 0.0
            margin = tolerance if side < 0 else sliver
            a = pyramids[row, at]
            b = pyramids[row, at + 1]
            c = pyramids[row, at + 2]
            low = math.inf
            high = -math.inf
            for k in range(count):
                height = a * polygons[slot, k, 0] + b * polygons[slot, k, 1] + c * polygons[slot, k, 2]
                low = height if height < low else low
                high = height if height > high else high
            if high - offset <= margin:
                cut = CLEAR
            elif low - offset < -margin:
                cut |= PLANE if side < 0 else 1 << side
            side += 1
    return cut


class Sight(NamedTuple):
    """What polygons may stand between, and how one point sees them; raised where they are first asked for."""

    corners: Corners
    """(b, 4, 3)"""
    sides: IntArray
    """(b,) 3 or 4"""
    normals: FloatArray
    """(b, 3)"""
    pyramids: FloatArray
    """(b, PYRAMID)"""
    raised: Int64Array
    """(b,) for which point"""


@kernel
def make_sight(corners: Corners, sides: IntArray, normals: FloatArray) -> Sight:
    """Of polygons that no point has seen."""
    b = len(normals)
    return Sight(corners, sides, normals, np.empty((b, PYRAMID)), np.full(b, -1, dtype=np.int64))


@kernel
def _stands_aside(
    x: FloatArray,
    normal: FloatArray,
    corners: Corners,
    polygon: int,
    count: int,
    sources: FloatArray,
    source: int,
    sides: int,
) -> bool:
    """Whether a polygon is below the horizon, beyond a source, or outside one side of what is before it."""
    aside = False
    side = -2
    while side < sides and not aside:
        aside = True
        k = 0
        while k < count and aside:
            dx = corners[polygon, k, 0] - x[0]
            dy = corners[polygon, k, 1] - x[1]
            dz = corners[polygon, k, 2] - x[2]
            if side == -2:
                aside = normal[0] * dx + normal[1] * dy + normal[2] * dz <= 0.0
            else:
                at = NORMAL if side < 0 else 3 * side
                height = (
                    sources[source, at] * dx + sources[source, at + 1] * dy + sources[source, at + 2] * dz
                )
                aside = height >= sources[source, DISTANCE] if side < 0 else height <= 0.0
            k += 1
        side += 1
    return aside


@kernel
def cull(
    x: FloatArray,
    point: int,
    normal: FloatArray,
    polygons: FloatArray,
    slot: int,
    count: int,
    sources: FloatArray,
    source: int,
    source_sides: int,
    blockers: IntArray,
    first: int,
    stop: int,
    sight: Sight,
    tolerance: float,
    out: IntArray,
    used: int,
) -> int:
    """Which of blockers[first : stop] may hide some of a source from a point x (3,), to out[used:].

    The source's part above the horizon is a row of polygons (s, n, 3), relative to x; its own pyramid is a
    row of sources (p, PYRAMID). `point` is the number of x: rows of `sight` for other points are raised anew.
    Returns how many there are, or HIDDEN.
    """
    corners = sight.corners
    sides = sight.sides
    normals = sight.normals
    pyramids = sight.pyramids
    raised = sight.raised
    sliver = sliver_of(polygons, slot, count)
    kept = 0
    b = first
    while b < stop:
        blocker = blockers[b]
        b += 1
        if raised[blocker] != point:
            raise_pyramid(x, corners, blocker, sides[blocker], normals, blocker, tolerance, pyramids, blocker)
            raised[blocker] = point
        cut = sides_cut(polygons, slot, count, pyramids, blocker, sides[blocker], tolerance, sliver)
        if cut == 0:
            kept = HIDDEN
            b = stop
        elif cut != CLEAR and not _stands_aside(
            x, normal, corners, blocker, sides[blocker], sources, source, source_sides
        ):
            out[used + kept] = blocker
            kept += 1
    return kept
