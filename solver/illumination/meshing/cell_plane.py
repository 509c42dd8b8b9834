"""What lies where in the plane of one cell: vertices xy (n, 2) with radii (n,), lines between two of them.

The first `count` vertices are the ring of the cell.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.illumination.meshing.rails import APART
from solver.illumination.meshing.skeleton import MINIMUM_LENGTH
from solver.kernels import inline_kernel, kernel
from solver.types import FloatArray, IntArray

_CLEAR: Final = 1.25 * APART
"""A stretch gets a new point if this part of its rail is free on either side: more than points must be apart,
so that rounding never refuses one that was asked for."""


@inline_kernel
def project(x: FloatArray, center: FloatArray, frame: FloatArray, at: FloatArray) -> None:
    """Write the coordinates of x (3,) in a cell's frame (2, 3)."""
    for k in range(2):
        square = 0.0
        at[k] = 0.0
        for axis in range(3):
            at[k] += (x[axis] - center[axis]) * frame[k, axis]
            square += frame[k, axis] ** 2
        at[k] /= square


@kernel
def find_radii(
    xy: FloatArray, radius: FloatArray, count: int, corner: IntArray, sides: int, most: float
) -> None:
    """Radii of the vertices of a ring: half the distance of any two at most, a quarter of that of sides.

    `corner` (sides + 1,) tells where sides begin. In a corner that is acute, both sides are near.
    """
    radius[:count] = most
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        half = 0.5 * np.sqrt((xy[j, 0] - xy[i, 0]) ** 2 + (xy[j, 1] - xy[i, 1]) ** 2)
        radius[i] = min(radius[i], half)
        radius[j] = min(radius[j], half)
    for i in range(count):
        for s in range(sides):
            a = corner[s]
            b = corner[s + 1] if s + 1 < sides else 0
            if a <= i <= corner[s + 1] or (i == 0 and b == 0):
                continue
            along, _ = beside(xy, xy[i], a, b)
            along = min(1.0, max(0.0, along))
            x = xy[a, 0] + along * (xy[b, 0] - xy[a, 0]) - xy[i, 0]
            y = xy[a, 1] + along * (xy[b, 1] - xy[a, 1]) - xy[i, 1]
            radius[i] = min(radius[i], 0.25 * np.sqrt(x * x + y * y))


@inline_kernel
def stretches_between(corner: IntArray, sides: int, count: int, a: int, b: int) -> tuple[int, int]:
    """The stretches of a ring between two of its places on the same side, as a range; else -1, -1."""
    if a >= count or b >= count:
        return -1, -1
    for s in range(sides):
        # The place where the last side ends is that where the first begins.
        i = count if a == 0 and s == sides - 1 else a
        j = count if b == 0 and s == sides - 1 else b
        if corner[s] <= min(i, j) and max(i, j) <= corner[s + 1]:
            return min(i, j), max(i, j)
    return -1, -1


@inline_kernel
def beside(xy: FloatArray, x: FloatArray, a: int, b: int) -> tuple[float, float]:
    """Where x projects to on the line a -> b, as a fraction, and its squared distance from the line."""
    dx = xy[b, 0] - xy[a, 0]
    dy = xy[b, 1] - xy[a, 1]
    ex = x[0] - xy[a, 0]
    ey = x[1] - xy[a, 1]
    square = dx * dx + dy * dy
    cross = dx * ey - dy * ex
    return (dx * ex + dy * ey) / square, cross * cross / square


@inline_kernel
def vertex_near(xy: FloatArray, radius: FloatArray, total: int, point: FloatArray, within: float) -> int:
    """The vertex that `point` is nearest to, in radii of at most `within`, if nearer than two; or -1."""
    found = -1
    nearest = 4.0
    for i in range(total):
        r = min(radius[i], within)
        share = ((xy[i, 0] - point[0]) ** 2 + (xy[i, 1] - point[1]) ** 2) / (r * r)
        if share < nearest:
            nearest = share
            found = i
    return found


@inline_kernel
def vertex_beside(xy: FloatArray, radius: FloatArray, total: int, a: int, b: int) -> int:
    """The vertex nearest to the line a - b, of those that it comes nearer to than their radius, or -1."""
    dx = xy[b, 0] - xy[a, 0]
    dy = xy[b, 1] - xy[a, 1]
    square = dx * dx + dy * dy
    found = -1
    nearest = np.inf
    for i in range(total):
        ex = xy[i, 0] - xy[a, 0]
        ey = xy[i, 1] - xy[a, 1]
        along = dx * ex + dy * ey
        off = (dx * ey - dy * ex) ** 2
        if (
            0.0 < along < square
            and off < radius[i] * radius[i] * square
            and off < nearest
            and i not in (a, b)
        ):
            nearest = off
            found = i
    return found


@inline_kernel
def _side_of(xy: FloatArray, a: int, b: int, x: int) -> float:
    """Positive if x lies to the left of a -> b."""
    dx = xy[b, 0] - xy[a, 0]
    dy = xy[b, 1] - xy[a, 1]
    return float(dx * (xy[x, 1] - xy[a, 1]) - dy * (xy[x, 0] - xy[a, 0]))


@inline_kernel
def line_met(xy: FloatArray, line: IntArray, lines: int, a: int, b: int) -> tuple[int, bool]:
    """A line that crosses a - b, or is the same (then True); or -1.

    Of lines on one line the sides are mere rounding; those are told apart by their extents.
    """
    low_x, high_x = min(xy[a, 0], xy[b, 0]), max(xy[a, 0], xy[b, 0])
    low_y, high_y = min(xy[a, 1], xy[b, 1]), max(xy[a, 1], xy[b, 1])
    for i in range(lines):
        c = line[i, 0]
        d = line[i, 1]
        if (c == a and d == b) or (c == b and d == a):
            return i, True
        if c in (a, b) or d in (a, b):
            continue
        if max(xy[c, 0], xy[d, 0]) < low_x or min(xy[c, 0], xy[d, 0]) > high_x:
            continue
        if max(xy[c, 1], xy[d, 1]) < low_y or min(xy[c, 1], xy[d, 1]) > high_y:
            continue
        if (_side_of(xy, a, b, c) > 0.0) != (_side_of(xy, a, b, d) > 0.0) and (
            _side_of(xy, c, d, a) > 0.0
        ) != (_side_of(xy, c, d, b) > 0.0):
            return i, False
    return -1, False


@inline_kernel
def intersect(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, point: FloatArray) -> None:
    """Write where a - b crosses c - d."""
    from_c = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    from_d = (b[0] - a[0]) * (d[1] - a[1]) - (b[1] - a[1]) * (d[0] - a[0])
    t = from_c / (from_c - from_d)
    point[0] = c[0] + t * (d[0] - c[0])
    point[1] = c[1] + t * (d[1] - c[1])


@inline_kernel
def stretch_near(
    xy: FloatArray,
    count: int,
    point: FloatArray,
    within: float,
    low: FloatArray,
    high: FloatArray,
    ring: int,
) -> tuple[int, float]:
    """The stretch of the ring that `point` is on, and where; t is 0 where it is one of its ends; or -1.

    Stretches run from `low` to `high` on their rails, those of the ring from `ring` on. A point that is on a
    stretch is moved onto it.
    """
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        along, square = beside(xy, point, i, j)
        part = abs(high[ring + i] - low[ring + i])
        length = ((xy[j, 0] - xy[i, 0]) ** 2 + (xy[j, 1] - xy[i, 1]) ** 2) / (part * part)
        if 0.0 < along < 1.0 and square < min(within * within, MINIMUM_LENGTH * MINIMUM_LENGTH * length):
            if min(along, 1.0 - along) * part < _CLEAR:
                return (i if along < 0.5 else j), 0.0
            point[0] = xy[i, 0] + along * (xy[j, 0] - xy[i, 0])
            point[1] = xy[i, 1] + along * (xy[j, 1] - xy[i, 1])
            return i, along
    return -1, 0.0
