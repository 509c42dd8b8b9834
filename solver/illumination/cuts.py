"""Cutting convex pieces by planes, with room that suffices whatever rounding does.

A cut finds two crossings (`cut`), so that either part has at most one corner more than the whole. A piece
that meets a blocker has VERTICES corners at most and is cut five times at most, by the plane and four sides:
what comes of it has VERTICES + 5 at most. One piece is worked on at a time, the last that was put off. If t
wait when it is taken, itself included, then t + 5 do after it was cut in five, where it is the half of one
that had too many corners, and t + 4 otherwise. That is at most 1 + 5 b after b blockers, and one more where
the last is halved.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from solver.kernels import kernel
from solver.types import FloatArray, IntArray

VERTICES: Final = 12
"""A piece with more corners is cut in two."""

PER_BLOCKER: Final = 5
"""Pieces that wait for later blockers, at most, for each blocker."""

ROOM: Final = VERTICES + 6
"""Corners for which a buffer of a piece has room."""

WHOLE: Final = 0
ABOVE: Final = 1
_HEIGHTS: Final = 2
PIECE: Final = 1
REST: Final = 3
"""Slots of the working space: a source, its part above the horizon; heights of corners; the piece that is
worked on, where what is above the horizon was, and two by turns for what of it is still inside."""


class Buffers(NamedTuple):
    """What clipping works on."""

    stack: FloatArray
    """(2 + PER_BLOCKER * blockers, ROOM, 3) pieces that wait"""
    corners: IntArray
    """how many corners they have"""
    blocker: IntArray
    """and the first blocker that they have still to meet"""
    work: FloatArray
    """(5, ROOM, 3) slots"""


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


@kernel
def cut(
    work: FloatArray,
    slot: int,
    count: int,
    a: float,
    b: float,
    c: float,
    offset: float,
    margin: float,
    above: int,
    stack: FloatArray,
    below: int,
) -> tuple[int, int]:
    """Cut the convex polygon in a slot of `work` by a x + b y + c z = offset, into slots of work and stack.

    What reaches past it by `margin` metres or less does not. The corners that are above are those next to
    the highest in a row, so that there are two crossings, also where rounding has more changes of sign.
    Returns the numbers of corners above and below.
    """
    low = math.inf
    high = -math.inf
    first = 0
    for k in range(count):
        height = a * work[slot, k, 0] + b * work[slot, k, 1] + c * work[slot, k, 2] - offset
        work[_HEIGHTS, k, 0] = height
        low = height if height < low else low
        if height > high:
            high = height
            first = k
    up = 0
    down = 0
    if low >= -margin:
        for k in range(count):
            for axis in range(3):
                work[above, k, axis] = work[slot, k, axis]
        up = count
    elif high <= margin:
        for k in range(count):
            for axis in range(3):
                stack[below, k, axis] = work[slot, k, axis]
        down = count
    else:
        last = first - 1 if first > 0 else count - 1
        while work[_HEIGHTS, last, 0] > 0.0:
            first = last
            last = first - 1 if first > 0 else count - 1
        k = first
        while work[_HEIGHTS, k, 0] > 0.0:
            for axis in range(3):
                work[above, up, axis] = work[slot, k, axis]
            up += 1
            last = k
            k = k + 1 if k + 1 < count else 0
        # Out through the edge from `last` to k.
        share = work[_HEIGHTS, last, 0] / (work[_HEIGHTS, last, 0] - work[_HEIGHTS, k, 0])
        for axis in range(3):
            value = work[slot, last, axis] + share * (work[slot, k, axis] - work[slot, last, axis])
            work[above, up, axis] = value
            stack[below, 0, axis] = value
        up += 1
        down = 1 if work[_HEIGHTS, k, 0] < 0.0 else 0
        while k != first:
            for axis in range(3):
                stack[below, down, axis] = work[slot, k, axis]
            down += 1
            last = k
            k = k + 1 if k + 1 < count else 0
        # In again through the edge from `last` to `first`.
        share = work[_HEIGHTS, first, 0] / (work[_HEIGHTS, first, 0] - work[_HEIGHTS, last, 0])
        for axis in range(3):
            value = work[slot, first, axis] + share * (work[slot, last, axis] - work[slot, first, axis])
            work[above, up, axis] = value
            stack[below, down, axis] = value
        up += 1
        down += 1 if work[_HEIGHTS, last, 0] < 0.0 else 0
    return up, down


@kernel
def clip_above(buffers: Buffers, count: int, normal: FloatArray) -> int:
    """Put the part above the horizon of the polygon in slot WHOLE, relative to the point, into slot ABOVE.

    Returns its number of corners.
    """
    up, _ = cut(
        buffers.work, WHOLE, count, normal[0], normal[1], normal[2], 0.0, 0.0, ABOVE, buffers.stack, 0
    )
    return up


@kernel
def halve(stack: FloatArray, corners: IntArray, blocker: IntArray, top: int) -> None:
    """Cut the piece at `top` in two, through corners; the second goes on top."""
    n = corners[top]
    half = n // 2
    for k in range(half, n):
        for axis in range(3):
            stack[top + 1, k - half, axis] = stack[top, k, axis]
    for axis in range(3):
        stack[top + 1, n - half, axis] = stack[top, 0, axis]
    corners[top] = half + 1
    corners[top + 1] = n - half + 1
    blocker[top + 1] = blocker[top]
