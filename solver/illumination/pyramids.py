"""What a convex blocker hides from a point: the inside of a pyramid, beyond the blocker's plane ([H 6.2]).

Places are taken from the point, so that the pyramid's sides have no offset: a place is hidden if it is above
all sides, and beyond the plane.
"""

from __future__ import annotations

import math
from typing import Final

from solver.kernels import inline_kernel, kernel
from solver.types import FloatArray

NORMAL: Final = 12
DISTANCE: Final = 15
PYRAMID: Final = 16
"""Columns of a pyramid's row: unit normals of four sides, inside above; the plane's unit normal away from the
point; its distance in metres, 0 where the point is on it and nothing is hidden."""

SLIVER: Final = 1e-14
"""What reaches past a side by less than this angle does not: so much may rounding make of an edge that two
blockers, or blocker and source, have in common."""


@kernel
def raise_pyramid(
    x: FloatArray, polygon: FloatArray, count: int, normal: FloatArray, tolerance: float, row: FloatArray
) -> None:
    """Fill row (PYRAMID,) with what a polygon (4, 3) with a unit normal (3,) hides from a point x (3,).

    A point within `tolerance` metres of the polygon's plane is on it.
    """
    distance = 0.0
    for axis in range(3):
        distance += normal[axis] * (polygon[0, axis] - x[axis])
    if abs(distance) <= tolerance:
        row[DISTANCE] = 0.0
        return
    sign = 1.0 if distance > 0.0 else -1.0
    for axis in range(3):
        row[NORMAL + axis] = sign * normal[axis]
    row[DISTANCE] = sign * distance
    last = count - 1
    for k in range(count):
        ax = polygon[last, 0] - x[0]
        ay = polygon[last, 1] - x[1]
        az = polygon[last, 2] - x[2]
        # Not from corner to corner: their cross product would lose the digits of what is small or far away.
        ex = polygon[k, 0] - polygon[last, 0]
        ey = polygon[k, 1] - polygon[last, 1]
        ez = polygon[k, 2] - polygon[last, 2]
        sx = ay * ez - az * ey
        sy = az * ex - ax * ez
        sz = ax * ey - ay * ex
        length = math.sqrt(sx * sx + sy * sy + sz * sz)
        if length > 0.0:
            row[3 * k] = sign * sx / length
            row[3 * k + 1] = sign * sy / length
            row[3 * k + 2] = sign * sz / length
        else:
            # An edge without length cuts nothing: all that is beyond the plane is above it.
            for axis in range(3):
                row[3 * k + axis] = row[NORMAL + axis]
        last = k


@inline_kernel
def height_over(row: FloatArray, at: int, polygon: FloatArray, k: int) -> float:
    """Height of corner k over the plane through the point whose normal is row[at : at + 3]."""
    return float(row[at] * polygon[k, 0] + row[at + 1] * polygon[k, 1] + row[at + 2] * polygon[k, 2])


@inline_kernel
def reach_of(polygon: FloatArray, count: int) -> float:
    """Distance from the point to the farthest corner."""
    square = 0.0
    for k in range(count):
        square = max(square, polygon[k, 0] ** 2 + polygon[k, 1] ** 2 + polygon[k, 2] ** 2)
    return math.sqrt(square)


@inline_kernel
def is_clear(
    polygon: FloatArray, count: int, row: FloatArray, sides: int, tolerance: float, sliver: float
) -> bool:
    """Whether a polygon (n, 3) relative to the point is not beyond a blocker, or outside one of its sides.

    tolerance and sliver are metres: of the blocker's plane, and of its sides.
    """
    if row[DISTANCE] <= 0.0:
        return True
    clear = True
    for k in range(count):
        if height_over(row, NORMAL, polygon, k) - row[DISTANCE] > tolerance:
            clear = False
            break
    if clear:
        return True
    for side in range(sides):
        clear = True
        for k in range(count):
            if height_over(row, 3 * side, polygon, k) > sliver:
                clear = False
                break
        if clear:
            return True
    return False
