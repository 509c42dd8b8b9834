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

from solver.kernels import inline_kernel, kernel
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


@inline_kernel
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
        first = k if height > high else first
        high = height if height > high else high
    if low >= -margin:
        run = count
    elif high <= margin:
        run = 0
    else:
        # Back to the first of those above, and on to the last.
        goes_on = True
        for _ in range(count):
            before = first - 1 if first > 0 else count - 1
            goes_on = goes_on and work[_HEIGHTS, before, 0] > 0.0
            first = before if goes_on else first
        run = 0
        goes_on = True
        for k in range(count):
            at = first + k if first + k < count else first + k - count
            goes_on = goes_on and work[_HEIGHTS, at, 0] > 0.0
            run += 1 if goes_on else 0
    for k in range(run):
        at = first + k if first + k < count else first + k - count
        for axis in range(3):
            work[above, k, axis] = work[slot, at, axis]
    crossings = 1 if 0 < run < count else 0
    down = 0
    for _ in range(crossings):
        last = first + run - 1 if first + run - 1 < count else first + run - 1 - count
        after = last + 1 if last + 1 < count else 0
        down += _cross(work, slot, last, after, above, run, stack, below, 0)
    for k in range(run, count):
        at = first + k if first + k < count else first + k - count
        for axis in range(3):
            stack[below, down, axis] = work[slot, at, axis]
        down += 1
    for _ in range(crossings):
        before = first - 1 if first > 0 else count - 1
        down += _cross(work, slot, first, before, above, run + 1, stack, below, down)
    return run + 2 * crossings, down


@inline_kernel
def _cross(
    work: FloatArray,
    slot: int,
    high: int,
    low: int,
    above: int,
    up: int,
    stack: FloatArray,
    below: int,
    down: int,
) -> int:
    """Put the place where the edge from a corner above to one that is not crosses into both parts.

    Returns the number of corners that the part below gains: none where the lower corner is that place.
    """
    share = work[_HEIGHTS, high, 0] / (work[_HEIGHTS, high, 0] - work[_HEIGHTS, low, 0])
    for axis in range(3):
        value = work[slot, high, axis] + share * (work[slot, low, axis] - work[slot, high, axis])
        work[above, up, axis] = value
        stack[below, down, axis] = value
    return 1 if work[_HEIGHTS, low, 0] < 0.0 else 0


@kernel
def clip_above(work: FloatArray, stack: FloatArray, count: int, normal: FloatArray) -> int:
    """Put the part above the horizon of the polygon in slot WHOLE, relative to the point, into slot ABOVE.

    Returns its number of corners; overwrites slot 0 of the stack.
    """
    up, _ = cut(work, WHOLE, count, normal[0], normal[1], normal[2], 0.0, 0.0, ABOVE, stack, 0)
    return up


@inline_kernel
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
