"""What points anywhere receive, on surfaces or off: all patches are asked, and all that is seen is exact."""

from __future__ import annotations

import numpy as np

from solver.illumination.points.cuts import ABOVE, WHOLE, clip_above
from solver.illumination.points.desk import Desk, Elements, Light, height_before, lay, make_desk
from solver.illumination.points.factor_lanes import (
    FACTOR,
    HIGHEST,
    LANES,
    LOWEST,
    fill_lane,
    find_factors,
    polygon_of_lane,
)
from solver.illumination.points.pyramids import DISTANCE, NORMAL, SIDES, make_sight, raise_pyramid
from solver.illumination.points.source_light import add_waiting
from solver.illumination.points.visible_parts import factor_of
from solver.kernels import kernel
from solver.types import Corners, FloatArray, IntArray, Points
from solver.visibility.bvh import walk_hierarchy

PLANES = 6
"""Bounding planes of the hull of a point and a patch."""


@kernel
def gather_anywhere(
    positions: Points,
    normals: FloatArray,
    accuracy: float,
    low: FloatArray,
    high: FloatArray,
    skip: IntArray,
    leaf_first: IntArray,
    leaf_count: IntArray,
    order: IntArray,
    elements: Elements,
    light: Light,
    side_tolerance: float,
    blocker_tolerance: float,
    source_tolerance: float,
    start: int,
    stop: int,
    out: FloatArray,
) -> None:
    """Irradiance out (n, channels) at points [start, stop) of positions and normals (n, 3).

    `light` is whole radiosities, emission included; the hierarchy (low ... order) is over the blockers.
    Tolerances are metres: of boxes over a shaft's sides, and of the planes of blockers and of sources, on
    which a point sees them edge-on.
    """
    patches = len(elements.normals)
    desk = make_desk(len(order))
    sight = make_sight(elements.corners[:patches], elements.corner_count[:patches], elements.normals)
    planes = np.empty((PLANES, 4))
    sources = np.empty(patches, dtype=np.int32)
    for i in range(start, stop):
        x = positions[i]
        normal = normals[i]
        found, total = seen_sources(x, normal, elements, light, source_tolerance, desk, sources)
        for c in range(out.shape[1]):
            out[i, c] = 0.0
        waiting = 0
        used = 0
        for k in range(found):
            p = sources[k]
            sides = point_shaft(
                x,
                normal,
                elements.corners,
                elements.corner_count[p],
                elements.normals,
                p,
                desk.pyramid,
                planes,
            )
            blockers = walk_hierarchy(
                low, high, skip, leaf_first, leaf_count, order, planes, sides, side_tolerance,
                desk.pool[used:],
            )  # fmt: skip
            lay(
                desk.waiting,
                desk.polygon,
                desk.visibility,
                waiting,
                x,
                elements.corners,
                p,
                used,
                blockers,
                1.0,
            )
            waiting += 1
            used += blockers
            if waiting == LANES or k == found - 1:
                add_waiting(
                    x, i, normal, desk, waiting, used, desk.pool, accuracy * total, 0.0, elements, light,
                    sight, blocker_tolerance, out,
                )  # fmt: skip
                waiting = 0
                used = 0


@kernel
def seen_sources(
    x: FloatArray,
    normal: FloatArray,
    elements: Elements,
    light: Light,
    tolerance: float,
    desk: Desk,
    sources: IntArray,
) -> tuple[int, float]:
    """The patches that a point would receive light from if nothing were in between, and how much, W/m2."""
    corners = elements.corners
    corner_count = elements.corner_count
    normals = elements.normals
    luminance = light.luminance
    block = desk.block
    lane = desk.lane
    stack = desk.buffers.stack
    work = desk.buffers.work
    found = 0
    lanes = 0
    total = 0.0
    patches = len(normals)
    for p in range(patches):
        if luminance[p] > 0.0 and height_before(x, corners, p, normals, p) > tolerance:
            lane[lanes, 0] = p
            fill_lane(block, lanes, x, corners, p, corner_count[p], normals, p)
            lanes += 1
        if lanes == LANES or p == patches - 1:
            find_factors(block, normal[0], normal[1], normal[2])
            for k in range(lanes):
                source = lane[k, 0]
                factor = block[FACTOR + k] if block[HIGHEST + k] > 0.0 else 0.0
                if block[LOWEST + k] < 0.0 and block[HIGHEST + k] > 0.0:
                    polygon_of_lane(block, k, corner_count[source], work, WHOLE)
                    count = clip_above(work, stack, corner_count[source], normal)
                    factor = factor_of(work, ABOVE, count, normal)
                if factor > 0.0:
                    sources[found] = source
                    found += 1
                    total += factor * luminance[source]
            lanes = 0
    return found, total


@kernel
def point_shaft(
    x: FloatArray,
    normal: FloatArray,
    corners: Corners,
    sides: int,
    normals: FloatArray,
    p: int,
    pyramid: FloatArray,
    planes: FloatArray,
) -> int:
    """Planes (PLANES, 4) around the hull of a point and a patch before which it is, as `shaft_planes`.

    pyramid (1, PYRAMID) is working space.
    """
    raise_pyramid(x, corners, p, sides, normals, p, 0.0, pyramid, 0)
    for axis in range(3):
        planes[0, axis] = -pyramid[0, NORMAL + axis]
        planes[1, axis] = normal[axis]
        for k in range(sides):
            planes[2 + k, axis] = pyramid[0, SIDES + 3 * k + axis]
    for k in range(2 + sides):
        planes[k, 3] = planes[k, 0] * x[0] + planes[k, 1] * x[1] + planes[k, 2] * x[2]
    planes[0, 3] -= pyramid[0, DISTANCE]
    return 2 + sides
