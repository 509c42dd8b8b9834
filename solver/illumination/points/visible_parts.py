"""The part of a source that a point sees past its blockers, exactly: successive convex clipping ([H 6.2]).

Seen from the point, a convex blocker hides the inside of a pyramid beyond its own plane. A convex piece of
the source is cut by the blocker's plane and by the pyramid's sides, one after the other: what is on the near
side or outside a side goes on to the next blocker, what is inside all of them is hidden. Pieces are convex,
the visible ones tile what is seen, and their form factors add up. [H] triangulates the projected edges and
asks one ray per triangle: this is the same partition, less the cells that no blocker's outline cuts, and
needs neither.

A point on a blocker's plane sees the blocker edge-on: it hides nothing there. [H 6.3]'s limit from one side
is what a point moved to that side sees. A blocker in the plane of the source hides nothing of it.
"""

from __future__ import annotations

import math

from solver.illumination.points.cuts import (
    ABOVE,
    PIECE,
    REST,
    VERTICES,
    cut,
    halve,
)
from solver.illumination.points.factor_lanes import angle_of
from solver.illumination.points.pyramids import (
    CLEAR,
    DISTANCE,
    NORMAL,
    PLANE,
    SIDES,
    cone_of,
    cones_part,
    sides_cut,
)
from solver.kernels import inline_kernel, kernel
from solver.types import FloatArray, IntArray


@inline_kernel
def factor_of(polygons: FloatArray, slot: int, count: int, normal: FloatArray) -> float:
    """Form factor of a row of polygons (s, n, 3), relative to the point and above its horizon [H eq. 6.1]."""
    total = 0.0
    last = count - 1
    for k in range(count):
        ax = polygons[slot, last, 0]
        ay = polygons[slot, last, 1]
        az = polygons[slot, last, 2]
        bx = polygons[slot, k, 0]
        by = polygons[slot, k, 1]
        bz = polygons[slot, k, 2]
        ex = bx - ax
        ey = by - ay
        ez = bz - az
        cx = ay * ez - az * ey
        cy = az * ex - ax * ez
        cz = ax * ey - ay * ex
        length = math.sqrt(cx * cx + cy * cy + cz * cz)
        if length > 0.0:
            angle = angle_of(length, ax * bx + ay * by + az * bz)
            total -= angle * (normal[0] * cx + normal[1] * cy + normal[2] * cz) / length
        last = k
    return total * (0.5 / math.pi)


@kernel
def clip_by_pyramids(
    normal: FloatArray,
    count: int,
    blockers: IntArray,
    start: int,
    stop: int,
    pyramids: FloatArray,
    sides: IntArray,
    tolerance: float,
    stack: FloatArray,
    corners: IntArray,
    waiting_for: IntArray,
    work: FloatArray,
    parts: FloatArray,
    part_count: IntArray,
) -> tuple[float, int]:
    """Form factor from a point with unit normal (3,) to what is visible of the polygon in slot ABOVE.

    It is convex, has `count` <= 5 corners, shows the point its front, and is overwritten. It is seen past
    blockers[start : stop], rows of pyramids (b, PYRAMID) and of their numbers of sides (b,). stack, corners,
    waiting_for and work are those of `Buffers`. The visible pieces are written to parts (m, ROOM, 3) and
    part_count (m,): as many as fit.

    Returns the form factor and the number of visible pieces.
    """
    for k in range(count):
        for axis in range(3):
            stack[0, k, axis] = work[ABOVE, k, axis]
    corners[0] = count
    waiting_for[0] = start
    top = 1
    total = 0.0
    found = 0
    while top > 0:
        if corners[top - 1] > VERTICES:
            halve(stack, corners, waiting_for, top - 1)
            top += 1
        top -= 1
        n = corners[top]
        b = waiting_for[top]
        for k in range(n):
            for axis in range(3):
                work[PIECE, k, axis] = stack[top, k, axis]
        ax, ay, az, sine, cosine, sliver = cone_of(work, PIECE, n)
        hidden = False
        while b < stop and not hidden:
            blocker = blockers[b]
            b += 1
            planes = CLEAR
            if not cones_part(ax, ay, az, sine, cosine, pyramids, blocker):
                planes = sides_cut(work, PIECE, n, pyramids, blocker, sides[blocker], tolerance, sliver)
            if planes != CLEAR:
                # What is not hidden waits; if in the end nothing is, the piece stays whole.
                waiting = top
                hidden = True
                left = n
                here = PIECE
                there = REST
                side = -1
                while side < sides[blocker] and hidden:
                    if planes & (PLANE if side < 0 else 1 << side) != 0:
                        at = NORMAL if side < 0 else SIDES + 3 * side
                        left, outside = cut(
                            work, here, left, pyramids[blocker, at], pyramids[blocker, at + 1],
                            pyramids[blocker, at + 2], pyramids[blocker, DISTANCE] if side < 0 else 0.0,
                            tolerance if side < 0 else sliver, there, stack, waiting,
                        )  # fmt: skip
                        if outside >= 3:
                            corners[waiting] = outside
                            waiting_for[waiting] = b
                            waiting += 1
                        hidden = left >= 3
                        here = there
                        there = 2 * REST + 1 - there
                    side += 1
                if hidden:
                    top = waiting
        if not hidden:
            total += factor_of(work, PIECE, n, normal)
            if found < len(parts):
                for k in range(n):
                    for axis in range(3):
                        parts[found, k, axis] = work[PIECE, k, axis]
                part_count[found] = n
            found += 1
    return max(0.0, total), found
