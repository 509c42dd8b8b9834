"""The part of a source that a point sees past its blockers, exactly: successive convex clipping ([H 6.2]).

Seen from the point, a convex blocker hides the inside of a pyramid beyond its own plane. A convex piece of
the source is cut by the blocker's plane and by the pyramid's sides, one after the other: what is on the near
side or outside a side goes on to the next blocker, what is inside all of them is hidden. Pieces are convex,
the visible ones tile what is seen, and their form factors add up. [H] triangulates the projected edges and
asks one ray per triangle: this is the same partition, less the cells that no blocker's outline cuts, and
needs neither.

A point on a blocker's plane sees the blocker edge-on: it hides nothing there. [H 6.3]'s limit from one side
is what a point moved to that side sees. A blocker in the plane of the source hides nothing of it.

Room. A cut finds two crossings, whatever rounding does to heights (`_cut`), so that either part has at most
one corner more than the whole. A piece that meets a blocker has VERTICES corners at most and is cut five
times at most, by the plane and four sides: what comes of it has VERTICES + 5 at most. One piece is worked on
at a time, the last that was put off. If t wait when it is taken, itself included, then t + 5 do after it was
cut in five, where it is the half of one that had too many corners, and t + 4 otherwise. That is at most
1 + 5 b after b blockers, and one more where the last is halved.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from solver.illumination.pyramids import (
    DISTANCE,
    NORMAL,
    PYRAMID,
    SLIVER,
    height_over,
    is_clear,
    raise_pyramid,
    reach_of,
)
from solver.kernels import inline_kernel, kernel
from solver.transport.lambert import contour_sum
from solver.types import Corners, FloatArray, IntArray

VERTICES: Final = 12
"""A piece with more corners is cut in two."""

PER_BLOCKER: Final = 5
"""Pieces that wait for later blockers, at most, for each blocker."""

ROOM: Final = VERTICES + 6
"""Corners for which a buffer of a piece has room."""


class Buffers(NamedTuple):
    """What clipping works on."""

    stack: FloatArray
    """(2 + PER_BLOCKER * blockers, ROOM, 3) pieces that wait"""
    corners: IntArray
    """how many corners they have"""
    blocker: IntArray
    """and the first blocker that they have still to meet"""
    work: FloatArray
    """(5, ROOM, 3)"""


@kernel
def make_buffers(most_blockers: int) -> Buffers:
    """Buffers for up to so many blockers at once."""
    rows = 2 + PER_BLOCKER * most_blockers
    return Buffers(
        np.empty((rows, ROOM, 3)),
        np.empty(rows, dtype=np.int32),
        np.empty(rows, dtype=np.int32),
        np.empty((5, ROOM, 3)),
    )


@inline_kernel
def _put(source: FloatArray, k: int, target: FloatArray, at: int) -> None:
    for axis in range(3):
        target[at, axis] = source[k, axis]


@inline_kernel
def _copy(source: FloatArray, count: int, target: FloatArray) -> None:
    for k in range(count):
        _put(source, k, target, k)


@kernel
def _cut(
    polygon: FloatArray,
    count: int,
    row: FloatArray,
    at: int,
    offset: float,
    margin: float,
    heights: FloatArray,
    above: FloatArray,
    below: FloatArray,
) -> tuple[int, int]:
    """Cut a convex polygon by the plane row[at : at + 3] . p = offset into what is above and below.

    What reaches past it by `margin` metres or less does not. The corners that are above are those next to
    the highest in a row, so that there are two crossings, also where rounding has more changes of sign.
    Returns the numbers of corners.
    """
    low = np.inf
    high = -np.inf
    first = 0
    for k in range(count):
        height = height_over(row, at, polygon, k) - offset
        heights[k, 0] = height
        low = min(low, height)
        if height > high:
            high = height
            first = k
    if low >= -margin:
        _copy(polygon, count, above)
        return count, 0
    if high <= margin:
        _copy(polygon, count, below)
        return 0, count
    last = first - 1 if first > 0 else count - 1
    while heights[last, 0] > 0.0:
        first = last
        last = first - 1 if first > 0 else count - 1
    up = 0
    k = first
    while heights[k, 0] > 0.0:
        _put(polygon, k, above, up)
        up += 1
        last = k
        k = k + 1 if k + 1 < count else 0
    down = 0
    _cross(polygon, last, k, heights, above, up)
    up += 1
    if heights[k, 0] < 0.0:
        _put(above, up - 1, below, down)
        down += 1
    while k != first:
        _put(polygon, k, below, down)
        down += 1
        last = k
        k = k + 1 if k + 1 < count else 0
    _cross(polygon, first, last, heights, above, up)
    if heights[last, 0] < 0.0:
        _put(above, up, below, down)
        down += 1
    return up + 1, down


@inline_kernel
def _cross(
    polygon: FloatArray, high: int, low: int, heights: FloatArray, target: FloatArray, at: int
) -> None:
    """Where the edge from a corner above to one that is not crosses."""
    share = heights[high, 0] / (heights[high, 0] - heights[low, 0])
    for axis in range(3):
        target[at, axis] = polygon[high, axis] + share * (polygon[low, axis] - polygon[high, axis])


@kernel
def clip_above(
    polygon: FloatArray, count: int, normal: FloatArray, buffers: Buffers, above: FloatArray
) -> int:
    """The part of a polygon relative to the point that is above its horizon, into `above`; its corners."""
    up, _ = _cut(polygon, count, normal, 0, 0.0, 0.0, buffers.work[0], above, buffers.work[1])
    return up


@kernel
def clip_by_pyramids(
    normal: FloatArray,
    polygon: FloatArray,
    count: int,
    blockers: IntArray,
    start: int,
    stop: int,
    pyramids: FloatArray,
    sides: IntArray,
    tolerance: float,
    buffers: Buffers,
    parts: FloatArray,
    part_count: IntArray,
) -> tuple[float, int]:
    """Form factor from a point with unit normal (3,) to the visible part of a convex polygon (n <= 5, 3).

    The polygon is relative to the point, above its horizon, and shows it its front. It is seen past
    blockers[start : stop], rows of pyramids (b, PYRAMID) and of their numbers of sides (b,). The visible
    pieces are written to parts (m, ROOM, 3) and part_count (m,): as many as fit.

    Returns the form factor and the number of visible pieces.
    """
    stack = buffers.stack
    heights = buffers.work[0]
    piece = buffers.work[1]
    rest = buffers.work[2]
    inside = buffers.work[3]
    _copy(polygon, count, stack[0])
    buffers.corners[0] = count
    buffers.blocker[0] = start
    top = 1
    total = 0.0
    found = 0
    while top > 0:
        top -= 1
        n = buffers.corners[top]
        b = buffers.blocker[top]
        _copy(stack[top], n, piece)
        if n > VERTICES:
            half = n // 2
            _copy(piece, half + 1, stack[top])
            buffers.corners[top] = half + 1
            buffers.blocker[top] = b
            top += 1
            for k in range(half, n):
                _put(piece, k, stack[top], k - half)
            _put(piece, 0, stack[top], n - half)
            buffers.corners[top] = n - half + 1
            buffers.blocker[top] = b
            top += 1
            continue
        sliver = SLIVER * reach_of(piece, n)
        hidden = False
        while b < stop and not hidden:
            blocker = blockers[b]
            b += 1
            row = pyramids[blocker]
            if is_clear(piece, n, row, sides[blocker], tolerance, sliver):
                continue
            # What is not hidden waits; if in the end nothing is, the piece stays whole.
            waiting = top
            left, near = _cut(piece, n, row, NORMAL, row[DISTANCE], tolerance, heights, rest, stack[waiting])
            if near >= 3:
                buffers.corners[waiting] = near
                buffers.blocker[waiting] = b
                waiting += 1
            for side in range(sides[blocker]):
                if left < 3:
                    break
                left, outside = _cut(rest, left, row, 3 * side, 0.0, sliver, heights, inside, stack[waiting])
                if outside >= 3:
                    buffers.corners[waiting] = outside
                    buffers.blocker[waiting] = b
                    waiting += 1
                _copy(inside, left, rest)
            if left >= 3:
                hidden = True
                top = waiting
        if not hidden:
            total += contour_sum(0.0, 0.0, 0.0, normal[0], normal[1], normal[2], piece, n)
            if found < len(parts):
                _copy(piece, n, parts[found])
                part_count[found] = n
            found += 1
    return max(0.0, total), found


@kernel
def visible_factor(
    x: FloatArray,
    normal: FloatArray,
    source: FloatArray,
    source_count: int,
    blockers: IntArray,
    start: int,
    stop: int,
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    tolerance: float,
    stack: FloatArray,
    stack_count: IntArray,
    stack_next: IntArray,
    work: FloatArray,
    parts: FloatArray,
    part_count: IntArray,
) -> tuple[float, int]:
    """Form factor from a point x (3,) with unit normal (3,) to the visible part of a convex polygon (4, 3).

    Past the polygons blockers[start : stop] of corners (b, 4, 3), counts (b,), normals (b, 3); a point within
    `tolerance` metres of a blocker's plane is on it. stack (s, ROOM, 3), stack_count and stack_next
    (s,) need s = 2 + PER_BLOCKER (stop - start); work is (5, ROOM, 3). The visible pieces are written
    to parts (m, ROOM, 3) and part_count (m,), relative to x, where m > 0: as many as fit.

    Returns the form factor and the number of visible pieces: none where the point is behind the source.
    """
    buffers = Buffers(stack, stack_count, stack_next, work)
    relative = work[4]
    for k in range(source_count):
        for axis in range(3):
            relative[k, axis] = source[k, axis] - x[axis]
    if _turns_away(relative, source_count):
        return 0.0, 0
    polygon = np.empty((ROOM, 3))
    count = clip_above(relative, source_count, normal, buffers, polygon)
    if count < 3:
        return 0.0, 0
    number = stop - start
    pyramids = np.empty((number, PYRAMID))
    sides = np.empty(number, dtype=np.int32)
    rows = np.empty(number, dtype=np.int32)
    for k in range(number):
        p = blockers[start + k]
        rows[k] = k
        sides[k] = counts[p]
        raise_pyramid(x, corners[p], counts[p], normals[p], tolerance, pyramids[k])
    return clip_by_pyramids(
        normal, polygon, count, rows, 0, number, pyramids, sides, tolerance, buffers, parts, part_count
    )


@inline_kernel
def _turns_away(polygon: FloatArray, count: int) -> bool:
    """Whether a convex polygon relative to the point shows it its back, or its edge."""
    ux = polygon[2, 0] - polygon[0, 0]
    uy = polygon[2, 1] - polygon[0, 1]
    uz = polygon[2, 2] - polygon[0, 2]
    vx = polygon[count - 1, 0] - polygon[1, 0]
    vy = polygon[count - 1, 1] - polygon[1, 1]
    vz = polygon[count - 1, 2] - polygon[1, 2]
    return (
        float(
            (uy * vz - uz * vy) * polygon[0, 0]
            + (uz * vx - ux * vz) * polygon[0, 1]
            + (ux * vy - uy * vx) * polygon[0, 2]
        )
        >= 0.0
    )
