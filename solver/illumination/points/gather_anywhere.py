"""What points anywhere receive, on surfaces or off: all patches are asked.

What is seen of them is exact, but for patches that only reflect, and are too weak to count: of those a point
sees all or nothing, as of their middle.
"""

from __future__ import annotations

import numpy as np

from solver.illumination.points.cuts import ABOVE, WHOLE, clip_above
from solver.illumination.points.desk import (
    Desk,
    Elements,
    Light,
    height_before,
    lay,
    make_desk,
    relative_polygon,
)
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
from solver.illumination.points.source_light import add_from, add_waiting
from solver.illumination.points.standing_around import find_near, is_hidden, look_around, make_around
from solver.illumination.points.visible_parts import factor_of
from solver.kernels import kernel
from solver.types import BoolArray, Corners, FloatArray, IntArray, Points
from solver.visibility.bvh import walk_hierarchy

PLANES = 6
"""Bounding planes of the hull of a point and a patch."""

MOST_AROUND = 256
"""Of so many patches or fewer, all are asked at once which of them may be in between."""


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
    shines: BoolArray,
    side_tolerance: float,
    blocker_tolerance: float,
    source_tolerance: float,
    start: int,
    stop: int,
    out: FloatArray,
) -> None:
    """Irradiance out (n, channels) at points [start, stop) of positions and normals (n, 3).

    `light` is whole radiosities, emission included; a patch that `shines` (p,) is never too weak. The
    hierarchy (low ... order) is over the blockers.
    Tolerances are metres: of boxes over a shaft's sides, and of the planes of blockers and of sources, on
    which a point sees them edge-on.
    """
    patches = len(elements.normals)
    few = len(order) <= MOST_AROUND
    desk = make_desk(len(order))
    work = desk.buffers.work
    place = desk.place
    sight = make_sight(
        elements.corners[:patches], elements.corner_count[:patches], elements.normals, elements.solid,
        elements.bounds,
    )  # fmt: skip
    around = make_around(len(order) + 1 if few else 1)
    planes = np.empty((PLANES, 4))
    sources = np.empty(patches, dtype=np.int32)
    factors = np.empty(patches)
    for i in range(start, stop):
        x = positions[i]
        normal = normals[i]
        found, total = seen_sources(x, normal, elements, light, source_tolerance, desk, sources, factors)
        standing = look_around(x, i, normal, order, sight, blocker_tolerance, around) if few else 0
        for c in range(out.shape[1]):
            out[i, c] = 0.0
        waiting = 0
        used = 0
        for k in range(found):
            p = sources[k]
            sides = elements.corner_count[p]
            relative_polygon(x, elements.corners, p, sides, work, WHOLE)
            count = clip_above(work, desk.buffers.stack, sides, normal)
            if few:
                blockers = find_near(work, ABOVE, count, around, standing, desk.pool[used:])
            else:
                number = point_shaft(
                    x, normal, elements.corners, sides, elements.normals, p, desk.pyramid, planes
                )
                blockers = walk_hierarchy(
                    low, high, skip, leaf_first, leaf_count, order, planes, number, side_tolerance,
                    desk.pool[used:],
                )  # fmt: skip
            if not shines[p] and factors[k] * light.luminance[p] <= accuracy * total:
                _middle(work, ABOVE, count, place)
                if not is_hidden(x, i, place, desk.pool[used:], blockers, sight, blocker_tolerance):
                    add_from(
                        x, p, p, factors[k], place, elements.centroid, elements.axes, light.functions, out, i
                    )
                continue
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
            if waiting == LANES:
                add_waiting(
                    x, i, normal, desk, waiting, used, desk.pool, accuracy * total, 0.0, elements, light,
                    sight, blocker_tolerance, out,
                )  # fmt: skip
                waiting = 0
                used = 0
        if waiting > 0:
            add_waiting(
                x, i, normal, desk, waiting, used, desk.pool, accuracy * total, 0.0, elements, light, sight,
                blocker_tolerance, out,
            )  # fmt: skip


@kernel
def _middle(polygons: FloatArray, slot: int, count: int, place: FloatArray) -> None:
    """Put the middle of a row of polygons (s, n, 3) into place (4,), after a weight of 1."""
    place[0] = 1.0
    for axis in range(3):
        place[1 + axis] = 0.0
        for corner in range(count):
            place[1 + axis] += polygons[slot, corner, axis] / count


@kernel
def seen_sources(
    x: FloatArray,
    normal: FloatArray,
    elements: Elements,
    light: Light,
    tolerance: float,
    desk: Desk,
    sources: IntArray,
    factors: FloatArray,
) -> tuple[int, float]:
    """The patches that a point would receive light from if nothing were in between, and how much, W/m2.

    They are put into `sources` (p,), and their form factors into `factors` (p,).
    """
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
                    factors[found] = factor
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
