"""What stands around a point, and may hide a source from it: told by cones, all at once.

Where there are few polygons it is sooner done to hold the cones of all against that of a source, side by side
in lanes, than to walk down a hierarchy for every source; and what is below the horizon, or needless, is left
out once for all sources.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from solver.illumination.points.pyramids import (
    DISTANCE,
    NEARLY,
    NORMAL,
    SIDES,
    Sight,
    cone_of,
    look_at,
    raise_pyramid,
)
from solver.kernels import kernel
from solver.types import Float32Array, FloatArray, IntArray

ROWS: Final = 5
"""Axis, sine and cosine of half the angle of a cone."""


class Around(NamedTuple):
    """The cones of what stands around one point."""

    cones: Float32Array
    """(ROWS, b)"""
    polygon: IntArray
    """(b,)"""
    is_near: IntArray
    """(b,) whether it may hide some of a source: working space"""


@kernel
def make_around(most: int) -> Around:
    """For so many polygons at most."""
    return Around(
        np.empty((ROWS, most), dtype=np.float32),
        np.empty(most, dtype=np.int32),
        np.empty(most, dtype=np.int32),
    )


@kernel
def look_around(
    x: FloatArray,
    point: int,
    normal: FloatArray,
    members: IntArray,
    sight: Sight,
    tolerance: float,
    to: Around,
) -> int:
    """Collect which of `members` may hide anything from point number `point`, at x (3,); returns how many."""
    corners = sight.corners
    normals = sight.normals
    pyramids = sight.pyramids
    cones = sight.cones
    spheres = sight.spheres
    seen = sight.seen
    raised = sight.raised
    solid = sight.solid
    bounds = sight.bounds
    found = 0
    for k in range(len(members)):
        polygon = members[k]
        needless = look_at(x, polygon, corners, normals, spheres, solid, bounds, tolerance, cones)
        seen[polygon] = point
        if needless:
            pyramids[polygon, DISTANCE] = 0.0
            raised[polygon] = point
        over = spheres[polygon, 3]
        for axis in range(3):
            over += normal[axis] * (spheres[polygon, axis] - x[axis])
        for row in range(ROWS):
            to.cones[row, found] = cones[polygon, row]
        to.polygon[found] = polygon
        found += 1 if over > 0.0 and not needless else 0
    return found


@kernel
def find_near(polygons: FloatArray, slot: int, count: int, around: Around, found: int, out: IntArray) -> int:
    """Which of `found` polygons around have a cone in common with a row of polygons (s, n, 3), into `out`.

    Returns how many.
    """
    ax, ay, az, sine, cosine, _ = cone_of(polygons, slot, count)
    x, y, z = np.float32(ax), np.float32(ay), np.float32(az)
    s, c = np.float32(sine), np.float32(cosine)
    # From within its own cone all may be before it.
    slack = NEARLY if sine < 0.99999 else np.float32(4.0)
    cones = around.cones
    is_near = around.is_near
    for k in range(found):
        along = x * cones[0, k] + y * cones[1, k] + z * cones[2, k]
        is_near[k] = 1 if along + slack >= c * cones[4, k] - s * cones[3, k] else 0
    used = 0
    for k in range(found):
        out[used] = around.polygon[k]
        used += is_near[k]
    return used


@kernel
def is_hidden(
    x: FloatArray,
    point: int,
    place: FloatArray,
    blockers: IntArray,
    count: int,
    sight: Sight,
    tolerance: float,
) -> bool:
    """Whether one of `count` blockers, raised or not, hides a place (4,) from the point x (3,).

    The place comes after its weight, which is 1, and is relative to the point."""
    pyramids = sight.pyramids
    raised = sight.raised
    for k in range(count):
        blocker = blockers[k]
        sides = sight.sides[blocker]
        if raised[blocker] != point:
            raise_pyramid(
                x, sight.corners, blocker, sides, sight.normals, blocker, tolerance, pyramids, blocker
            )
            raised[blocker] = point
        beyond = -pyramids[blocker, DISTANCE]
        inside = math.inf
        for side in range(-1, sides):
            at = NORMAL if side < 0 else SIDES + 3 * side
            height = (
                pyramids[blocker, at] * place[1]
                + pyramids[blocker, at + 1] * place[2]
                + pyramids[blocker, at + 2] * place[3]
            )
            if side < 0:
                beyond += height
            else:
                inside = min(inside, height)
        if pyramids[blocker, DISTANCE] > 0.0 and beyond > tolerance and inside > 0.0:
            return True
    return False
