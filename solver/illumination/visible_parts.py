"""The part of a source that a point sees past its blockers, exactly: successive convex clipping ([H 6.2]).

Seen from the point, a convex blocker hides the inside of a pyramid beyond its own plane. A convex piece of
the source is cut by the pyramid's sides, one after the other: what is outside a side goes on to the next
blocker, what is inside all of them is hidden. Pieces are convex, the visible ones tile what is seen, and
their form factors add up. [H] triangulates the projected edges and asks one ray per triangle: this is the
same partition, less the cells that no blocker's outline cuts, and needs neither.

A point on a blocker's plane sees the blocker edge-on: it hides nothing there. [H 6.3]'s limit from one side
is what a point moved to that side sees.
"""

from __future__ import annotations

from typing import Final

from solver.kernels import inline_kernel, kernel
from solver.transport.lambert import contour_sum
from solver.types import Corners, FloatArray, IntArray

VERTICES: Final = 12
"""A piece with more corners is cut in two."""

PER_BLOCKER: Final = 6
"""Pieces that wait for later blockers, at most, for each blocker: four sides, its plane, a cut in two."""

ROOM: Final = VERTICES + 6
"""Corners for which a buffer of a piece has room."""


@inline_kernel
def _split(
    polygon: FloatArray,
    count: int,
    a: float,
    b: float,
    c: float,
    offset: float,
    above: FloatArray,
    below: FloatArray,
) -> tuple[int, int]:
    """Cut a convex polygon by a x + b y + c z = offset into the parts on either side; their corners."""
    up = 0
    down = 0
    last = count - 1
    height_last = a * polygon[last, 0] + b * polygon[last, 1] + c * polygon[last, 2] - offset
    for k in range(count):
        height = a * polygon[k, 0] + b * polygon[k, 1] + c * polygon[k, 2] - offset
        if (height_last > 0.0 and height < 0.0) or (height_last < 0.0 and height > 0.0):
            t = height_last / (height_last - height)
            for axis in range(3):
                value = polygon[last, axis] + t * (polygon[k, axis] - polygon[last, axis])
                above[up, axis] = value
                below[down, axis] = value
            up += 1
            down += 1
        if height >= 0.0:
            for axis in range(3):
                above[up, axis] = polygon[k, axis]
            up += 1
        if height <= 0.0:
            for axis in range(3):
                below[down, axis] = polygon[k, axis]
            down += 1
        last = k
        height_last = height
    return up, down


@inline_kernel
def _copy(source: FloatArray, count: int, target: FloatArray) -> None:
    for k in range(count):
        for axis in range(3):
            target[k, axis] = source[k, axis]


@kernel
def _is_clear(piece: FloatArray, count: int, blocker: FloatArray, sides: FloatArray, n: int) -> bool:
    """Whether a side of the blocker's pyramid or of the piece's has the other wholly outside."""
    for k in range(n):
        outside = True
        for j in range(count):
            if sides[k, 0] * piece[j, 0] + sides[k, 1] * piece[j, 1] + sides[k, 2] * piece[j, 2] > 0.0:
                outside = False
                break
        if outside:
            return True
    last = count - 1
    for j in range(count):
        # Pieces show their front, hence run clockwise as a pyramid's sides go.
        x = piece[j, 1] * piece[last, 2] - piece[j, 2] * piece[last, 1]
        y = piece[j, 2] * piece[last, 0] - piece[j, 0] * piece[last, 2]
        z = piece[j, 0] * piece[last, 1] - piece[j, 1] * piece[last, 0]
        outside = True
        for k in range(n):
            if x * blocker[k, 0] + y * blocker[k, 1] + z * blocker[k, 2] > 0.0:
                outside = False
                break
        if outside:
            return True
        last = j
    return False


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

    Returns the form factor and the number of visible pieces.
    """
    rel = work[0]
    for k in range(source_count):
        for axis in range(3):
            rel[k, axis] = source[k, axis] - x[axis]
    # Of the part above the horizon.
    count, _ = _split(rel, source_count, normal[0], normal[1], normal[2], 0.0, stack[0], work[1])
    if count < 3:
        return 0.0, 0
    stack_count[0] = count
    stack_next[0] = start
    top = 1
    total = 0.0
    found = 0
    blocker = work[2]
    sides = work[3]
    piece = work[4]
    while top > 0:
        top -= 1
        n = stack_count[top]
        b = stack_next[top]
        _copy(stack[top], n, piece)
        if n > VERTICES:
            half = n // 2
            _copy(piece, half + 1, stack[top])
            stack_count[top] = half + 1
            stack_next[top] = b
            top += 1
            for k in range(half, n):
                for axis in range(3):
                    stack[top, k - half, axis] = piece[k, axis]
            for axis in range(3):
                stack[top, n - half, axis] = piece[0, axis]
            stack_count[top] = n - half + 1
            stack_next[top] = b
            top += 1
            continue
        seen = True
        while b < stop:
            polygon = blockers[b]
            b += 1
            m = counts[polygon]
            nx = normals[polygon, 0]
            ny = normals[polygon, 1]
            nz = normals[polygon, 2]
            distance = (
                nx * (corners[polygon, 0, 0] - x[0])
                + ny * (corners[polygon, 0, 1] - x[1])
                + nz * (corners[polygon, 0, 2] - x[2])
            )
            if abs(distance) <= tolerance:
                continue
            sign = 1.0 if distance > 0.0 else -1.0
            nx *= sign
            ny *= sign
            nz *= sign
            distance *= sign
            beyond = False
            before = False
            for k in range(n):
                height = nx * piece[k, 0] + ny * piece[k, 1] + nz * piece[k, 2] - distance
                beyond = beyond or height > tolerance
                before = before or height < -tolerance
            if not beyond:
                continue
            for k in range(m):
                for axis in range(3):
                    blocker[k, axis] = corners[polygon, k, axis] - x[axis]
            last = m - 1
            for k in range(m):
                sides[k, 0] = sign * (blocker[last, 1] * blocker[k, 2] - blocker[last, 2] * blocker[k, 1])
                sides[k, 1] = sign * (blocker[last, 2] * blocker[k, 0] - blocker[last, 0] * blocker[k, 2])
                sides[k, 2] = sign * (blocker[last, 0] * blocker[k, 1] - blocker[last, 1] * blocker[k, 0])
                last = k
            if _is_clear(piece, n, blocker, sides, m):
                continue
            if before:
                far, near = _split(piece, n, nx, ny, nz, distance, rel, stack[top])
                if near >= 3:
                    stack_count[top] = near
                    stack_next[top] = b
                    top += 1
                _copy(rel, far, piece)
                n = far
            for k in range(m):
                if n < 3:
                    break
                inside, outside = _split(
                    piece, n, sides[k, 0], sides[k, 1], sides[k, 2], 0.0, rel, stack[top]
                )
                if outside >= 3:
                    stack_count[top] = outside
                    stack_next[top] = b
                    top += 1
                _copy(rel, inside, piece)
                n = inside
            seen = False
            break
        if seen:
            total += contour_sum(0.0, 0.0, 0.0, normal[0], normal[1], normal[2], piece, n)
            if found < len(parts):
                _copy(piece, n, parts[found])
                part_count[found] = n
            found += 1
    return max(0.0, total), found
