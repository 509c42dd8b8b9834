"""The clipping of one source past given blockers, as tests ask for it."""

from __future__ import annotations

import numpy as np

from solver.illumination.points.cuts import PER_BLOCKER, ROOM, WHOLE, clip_above
from solver.illumination.points.pyramids import PYRAMID, raise_pyramid
from solver.illumination.points.visible_parts import clip_by_pyramids
from solver.kernels import kernel
from solver.types import Corners, FloatArray, IntArray

__all__ = ["PER_BLOCKER", "ROOM", "visible_factor"]


@kernel
def _shows_front(polygons: FloatArray, slot: int, count: int) -> bool:
    """Whether a convex polygon relative to the point shows it its front, not its back or its edge."""
    ux = polygons[slot, 2, 0] - polygons[slot, 0, 0]
    uy = polygons[slot, 2, 1] - polygons[slot, 0, 1]
    uz = polygons[slot, 2, 2] - polygons[slot, 0, 2]
    vx = polygons[slot, count - 1, 0] - polygons[slot, 1, 0]
    vy = polygons[slot, count - 1, 1] - polygons[slot, 1, 1]
    vz = polygons[slot, count - 1, 2] - polygons[slot, 1, 2]
    along = (
        (uy * vz - uz * vy) * polygons[slot, 0, 0]
        + (uz * vx - ux * vz) * polygons[slot, 0, 1]
        + (ux * vy - uy * vx) * polygons[slot, 0, 2]
    )
    return bool(along < 0.0)


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
    for k in range(source_count):
        for axis in range(3):
            work[WHOLE, k, axis] = source[k, axis] - x[axis]
    factor = 0.0
    found = 0
    count = clip_above(work, stack, source_count, normal) if _shows_front(work, WHOLE, source_count) else 0
    if count >= 3:
        number = stop - start
        pyramids = np.empty((number, PYRAMID))
        sides = np.empty(number, dtype=np.int32)
        rows = np.arange(number).astype(np.int32)
        for k in range(number):
            p = blockers[start + k]
            sides[k] = counts[p]
            raise_pyramid(x, corners, p, counts[p], normals, p, tolerance, pyramids, k)
        factor, found = clip_by_pyramids(
            normal,
            count,
            rows,
            0,
            number,
            pyramids,
            sides,
            tolerance,
            stack,
            stack_count,
            stack_next,
            work,
            parts,
            part_count,
        )
    return factor, found
