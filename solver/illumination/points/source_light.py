"""The light that a point receives from sources, element by element ([H 6.2]).

A source is entered as far as its radiosity residual, times the point's form factor, is felt; leaves are
quartered where they are close and their gradient is felt. What is left counts with the radiosity where the
light that arrives from it comes from on average. Elements are taken in blocks, whose form factors are found
in lanes; only those that the horizon cuts, or that blockers may hide, are looked at alone. An element's
blockers are those of its parent that are not clear of it. Visible parts are exact, but for weak elements,
which count with the visibility v of their link. Of those a point sees all or nothing at worst, with a
variance of v (1 - v), and an allowance bounds the sum over all that are treated so.
"""

from __future__ import annotations

from typing import Final

from solver.illumination.points.cuts import ABOVE, PER_BLOCKER, WHOLE, clip_above
from solver.illumination.points.desk import DEPTH, PARTS, Desk, Elements, Light, lay
from solver.illumination.points.factor_lanes import (
    FACTOR,
    HIGHEST,
    LANES,
    LOWEST,
    WEIGHT,
    fill_lane,
    find_factors,
    polygon_of_lane,
)
from solver.illumination.points.pyramids import HIDDEN, Sight, cull, raise_pyramid
from solver.illumination.points.visible_parts import clip_by_pyramids, factor_of
from solver.kernels import kernel
from solver.types import FloatArray, IntArray, Points

_MISSED: Final = 0.5
"""Part of the linear variation of an element's radiosity that the places which stand for it miss at a point
that touches it. It falls with the fourth power of the distance where that is greater than the element."""

_TOGETHER: Final = 4.0
"""Elements that are hidden or seen together, side by side: errors are independent in groups of so many."""

_UNTOLD: Final = 1.0 / 64.0
"""Least variance of what a point sees of a source of which its element sees some, or seems to see all."""

_AT_MOST: Final = 1.0 / 64.0
"""Part of what is left of the allowance that one element may take: strong ones are left to be exact."""

_QUARTERED: Final = 8
"""How often a leaf may be quartered for it."""


@kernel
def _weigh(
    normal: FloatArray,
    source_normals: FloatArray,
    plane: int,
    polygons: FloatArray,
    slot: int,
    count: int,
    sums: FloatArray,
) -> None:
    """Add to sums (4,) the weight, and the weighted place, of places on a row of polygons (s, n, 3).

    It is convex and relative to the point. They lie in the triangles around its first corner, where they are
    exact for quadratics, and weigh as much as the light from there would count.
    """
    sx = source_normals[plane, 0]
    sy = source_normals[plane, 1]
    sz = source_normals[plane, 2]
    ax = polygons[slot, 0, 0]
    ay = polygons[slot, 0, 1]
    az = polygons[slot, 0, 2]
    for k in range(1, count - 1):
        ux = polygons[slot, k, 0] - ax
        uy = polygons[slot, k, 1] - ay
        uz = polygons[slot, k, 2] - az
        vx = polygons[slot, k + 1, 0] - ax
        vy = polygons[slot, k + 1, 1] - ay
        vz = polygons[slot, k + 1, 2] - az
        area = abs(sx * (uy * vz - uz * vy) + sy * (uz * vx - ux * vz) + sz * (ux * vy - uy * vx))
        for corner in range(3):
            along = 4.0 / 6.0 if corner == 1 else 1.0 / 6.0
            across = 4.0 / 6.0 if corner == 2 else 1.0 / 6.0
            px = ax + along * ux + across * vx
            py = ay + along * uy + across * vy
            pz = az + along * uz + across * vz
            here = normal[0] * px + normal[1] * py + normal[2] * pz
            there = -(sx * px + sy * py + sz * pz)
            square = px * px + py * py + pz * pz
            if here > 0.0 and there > 0.0:
                weight = area * here * there / (square * square)
                sums[0] += weight
                sums[1] += weight * px
                sums[2] += weight * py
                sums[3] += weight * pz


@kernel
def _quarter(
    work: FloatArray,
    count: int,
    lane: IntArray,
    k: int,
    first: int,
    blockers: int,
    visibility: float,
    waiting: IntArray,
    polygons: FloatArray,
    visibilities: FloatArray,
    top: int,
) -> None:
    """Let the quarters of the polygon in slot WHOLE wait from `top` on, lane k's but for its blockers."""
    for axis in range(3):
        middle = 0.0
        for corner in range(count):
            middle += work[WHOLE, corner, axis] / count
        for corner in range(4):
            # A triangle's fourth is the one in the middle.
            c = corner if corner < count else 0
            here = work[WHOLE, c, axis]
            ahead = 0.5 * (here + work[WHOLE, c + 1 if c + 1 < count else 0, axis])
            behind = 0.5 * (here + work[WHOLE, c - 1 if c > 0 else count - 1, axis])
            opposite = 0.5 * (work[WHOLE, 1, axis] + work[WHOLE, 2, axis])
            at = top + corner
            polygons[at, 0, axis] = here if corner < count else opposite
            polygons[at, 1, axis] = ahead if corner < count else behind
            polygons[at, 2, axis] = middle if count == 4 else (behind if corner < count else ahead)
            polygons[at, 3, axis] = behind if count == 4 else polygons[at, 2, axis]
    for at in range(top, top + 4):
        waiting[at, 0] = lane[k, 0]
        waiting[at, 1] = first
        waiting[at, 2] = blockers
        waiting[at, 3] = lane[k, 3] + 1
        visibilities[at] = visibility


@kernel
def add_from(
    x: FloatArray,
    e: int,
    p: int,
    factor: float,
    place: FloatArray,
    centroid: Points,
    axes: FloatArray,
    functions: FloatArray,
    out: FloatArray,
    row: int,
) -> None:
    """Add to a row of out the light of element e of patch p, by form factor and the place whence it comes."""
    u = 0.0
    v = 0.0
    if place[0] > 0.0:
        for axis in range(3):
            from_centroid = place[1 + axis] / place[0] + x[axis] - centroid[e, axis]
            u += axes[p, 0, axis] * from_centroid
            v += axes[p, 1, axis] * from_centroid
    for c in range(out.shape[1]):
        radiosity = functions[e, 0, c] + u * functions[e, 1, c] + v * functions[e, 2, c]
        out[row, c] += factor * max(0.0, radiosity)


@kernel
def add_waiting(
    x: FloatArray,
    point: int,
    normal: FloatArray,
    desk: Desk,
    top: int,
    used: int,
    far_pool: IntArray,
    limit: float,
    allowance: float,
    elements: Elements,
    light: Light,
    sight: Sight,
    tolerance: float,
    out: FloatArray,
) -> float:
    """Add to row `point` of out (n, channels) the irradiance at x (3,) from `top` elements on the desk.

    The point is before their fronts; their blockers take up `used` places of the desk's pool, or begin in
    `far_pool` at -1 less what is told as their first. Elements are entered
    whose residual brings more than `limit`; `allowance` is the squared error that the visibility of links may
    still make: its rest is returned.
    """
    # Fields are taken out once: each time counts as a reference.
    child = elements.child
    child_count = elements.child_count
    corners = elements.corners
    corner_count = elements.corner_count
    patch = elements.patch
    centroid = elements.centroid
    axes = elements.axes
    normals = elements.normals
    luminance = light.luminance
    spread = light.spread
    slope = light.slope
    extent = light.extent
    functions = light.functions
    lane = desk.lane
    lane_visibility = desk.lane_visibility
    block = desk.block
    pool = desk.pool
    pyramid = desk.pyramid
    place = desk.place
    parts = desk.parts
    part_count = desk.part_count
    waiting = desk.waiting
    polygons = desk.polygon
    visibilities = desk.visibility
    origin = desk.origin
    stack = desk.buffers.stack
    stack_corners = desk.buffers.corners
    stack_blocker = desk.buffers.blocker
    work = desk.buffers.work
    blocker_corners = sight.corners
    blocker_sides = sight.sides
    blocker_normals = sight.normals
    pyramids = sight.pyramids
    cones = sight.cones
    spheres = sight.spheres
    seen_cones = sight.seen
    raised = sight.raised
    solid = sight.solid
    bounds = sight.bounds
    spare = len(pool) - len(stack_corners) // PER_BLOCKER
    while top > 0:
        lanes = min(top, LANES)
        for k in range(lanes):
            top -= 1
            for column in range(4):
                lane[k, column] = waiting[top, column]
            lane_visibility[k] = visibilities[top]
            e = waiting[top, 0]
            fill_lane(block, k, origin, polygons, top, corner_count[e], normals, patch[e])
        find_factors(block, normal[0], normal[1], normal[2])
        for k in range(lanes):
            e = lane[k, 0]
            p = patch[e]
            first = lane[k, 1]
            blockers = lane[k, 2]
            sides = corner_count[e]
            count = sides
            # The horizon [H 6.2.1].
            is_cut = block[LOWEST + k] < 0.0
            factor = block[FACTOR + k] if block[HIGHEST + k] > 0.0 else 0.0
            if is_cut and block[HIGHEST + k] > 0.0:
                polygon_of_lane(block, k, sides, work, WHOLE)
                count = clip_above(work, stack, sides, normal)
                factor = factor_of(work, ABOVE, count, normal)
            # How far its radiosity is from what one place tells.
            square = 0.0
            for axis in range(3):
                middle = 0.0
                for corner in range(sides):
                    middle += block[(3 * corner + axis) * LANES + k]
                square += (middle / sides) ** 2
            smaller = 0.5 ** lane[k, 3]
            great = extent[e] * smaller * smaller
            close = great / (great + square)
            missed = _MISSED * close * close * smaller * slope[e]
            children = child_count[e] if child[e] >= 0 else 4
            variation = missed + (spread[e] if child[e] >= 0 else 0.0)
            enters = factor * variation > limit and top + children <= DEPTH and lane[k, 3] < _QUARTERED
            # Those who may hide some of it.
            brings = factor * luminance[e]
            seen = lane_visibility[k]
            unsure = _TOGETHER * max(seen * (1.0 - seen), _UNTOLD) * brings * brings
            if blockers > 0 and not enters and unsure <= _AT_MOST * allowance:
                allowance -= unsure
                factor *= seen
                blockers = 0
            if blockers > 0 and factor > 0.0:
                polygon_of_lane(block, k, sides, work, WHOLE)
                if not is_cut:
                    polygon_of_lane(block, k, sides, work, ABOVE)
                raise_pyramid(origin, work, WHOLE, sides, normals, p, 0.0, pyramid, 0)
                lists = far_pool if first < 0 else pool
                begin = -1 - first if first < 0 else first
                kept = cull(
                    x, point, normal, work, ABOVE, count, pyramid, 0, sides, lists, begin, begin + blockers,
                    blocker_corners, blocker_sides, blocker_normals, pyramids, cones, spheres, seen_cones,
                    raised, solid, bounds, tolerance, pool, used,
                )  # fmt: skip
                if kept == HIDDEN:
                    factor = 0.0
                elif not enters or used + kept <= spare:
                    first = used
                    blockers = kept
                    used += kept if enters else 0
            if factor > 0.0 and enters and child[e] >= 0:
                for c in range(child[e], child[e] + children):
                    if luminance[c] > 0.0:
                        lay(
                            waiting, polygons, visibilities, top, x, corners, c, first, blockers,
                            lane_visibility[k],
                        )  # fmt: skip
                        top += 1
            elif factor > 0.0 and enters:
                polygon_of_lane(block, k, sides, work, WHOLE)
                _quarter(
                    work, sides, lane, k, first, blockers, lane_visibility[k], waiting, polygons,
                    visibilities, top,
                )  # fmt: skip
                top += children
            elif factor > 0.0:
                # What is seen of it.
                for row in range(4):
                    place[row] = 0.0 if blockers > 0 or is_cut else block[WEIGHT + row * LANES + k]
                if blockers > 0:
                    factor, found = clip_by_pyramids(
                        normal, count, pool, first, first + blockers, pyramids, blocker_sides, tolerance,
                        stack, stack_corners, stack_blocker, work, parts, part_count,
                    )  # fmt: skip
                    for part in range(min(found, PARTS)):
                        _weigh(normal, normals, p, parts, part, part_count[part], place)
                elif is_cut:
                    _weigh(normal, normals, p, work, ABOVE, count, place)
                add_from(x, e, p, factor, place, centroid, axes, functions, out, point)
    return allowance
