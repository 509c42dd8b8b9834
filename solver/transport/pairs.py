"""Kernels over pairs of elements: which face each other, what stands between, what they exchange."""

from __future__ import annotations

import numpy as np

from solver.kernels import kernel
from solver.transport.exchange import exchange_area, heights
from solver.transport.variation import form_factor_variation, solve_moment
from solver.types import BoolArray, Corners, FloatArray, Int64Array, IntArray, Points
from solver.visibility.blockers import inherited_blockers
from solver.visibility.culling import BLOCK, LANES, gather_blocks
from solver.visibility.shafts import FULL, MAX_PLANES, NONE


@kernel
def mark_facing(
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    middle: Points,
    reach: FloatArray,
    tolerance: float,
    members: IntArray,
    rank: IntArray,
    base: int,
    start: int,
    stop: int,
    facing: BoolArray,
) -> None:
    """Mark in the rows facing[k - base] (p,) which patches members[k], k in [start, stop), faces.

    Those of less than its own `rank` (p,) are left out, so that members that are ranked by their places are
    paired once. middle (p, 3), reach (p,): the middle of each patch, and how far from it its corners are.
    """
    for k in range(start, stop):
        p = members[k]
        for q in range(len(corners)):
            if q == p or rank[q] < rank[p]:
                continue
            # Most of all pairs are told by the middles: the corners are asked where these are near the plane.
            over_p = 0.0
            over_q = 0.0
            for axis in range(3):
                over_p += (middle[q, axis] - corners[p, 0, axis]) * normals[p, axis]
                over_q += (middle[p, axis] - corners[q, 0, axis]) * normals[q, axis]
            if over_p + reach[q] < 0.0 or over_q + reach[p] < 0.0:
                continue
            if over_p <= 2.0 * tolerance:
                _, high = heights(corners[q], counts[q], corners[p, 0], normals[p])
                if high <= tolerance:
                    continue
            if over_q <= 2.0 * tolerance:
                _, high = heights(corners[p], counts[p], corners[q, 0], normals[q])
                if high <= tolerance:
                    continue
            facing[k - base, q] = True


@kernel
def inherit_blockers(
    p: IntArray,
    q: IntArray,
    corners: Corners,
    counts: IntArray,
    patch: IntArray,
    patch_corners: Corners,
    patch_counts: IntArray,
    normals: FloatArray,
    parent_start: Int64Array,
    parent_count: IntArray,
    parent_pool: IntArray,
    tolerance: float,
    start: int,
    stop: int,
    room: Int64Array,
    out: IntArray,
    kind: IntArray,
    kept: IntArray,
) -> None:
    """Visibility classes of pairs [start, stop), and which blockers of the parents' links are left."""
    planes = np.empty((MAX_PLANES, 4))
    work = np.empty(5 * LANES)
    verdict = np.empty(LANES, dtype=np.uint8)
    most = 0
    for pair in range(start, stop):
        most = max(most, parent_count[pair])
    blocks = np.empty((most + LANES - 1) // LANES * BLOCK)
    gathered = -1
    for pair in range(start, stop):
        if parent_count[pair] == 0:
            kind[pair] = FULL
            kept[pair] = 0
            continue
        if gathered < 0 or parent_start[pair] != parent_start[gathered]:
            gather_blocks(patch_corners, normals, parent_pool, parent_start[pair], parent_count[pair], blocks)
            gathered = pair
        i = p[pair]
        j = q[pair]
        kind[pair], kept[pair] = inherited_blockers(
            corners[i], counts[i], normals[patch[i]], corners[j], counts[j], normals[patch[j]],
            patch_corners, patch_counts, normals, parent_pool, parent_start[pair], parent_count[pair], blocks,
            tolerance, planes, work, verdict, out, room[pair],
        )  # fmt: skip


@kernel
def find_slopes(
    moment: FloatArray, element: IntArray, exchange: FloatArray, position: FloatArray, slope: FloatArray
) -> None:
    """Exchange (n,) per metre (n, 2) from the mean position (n, 2) of the light on the elements (n,)."""
    for link in range(len(element)):
        a, b = solve_moment(moment[element[link]], position[link, 0], position[link, 1])
        slope[link, 0] = exchange[link] * a
        slope[link, 1] = exchange[link] * b


@kernel
def find_exchange(
    p: IntArray,
    q: IntArray,
    kind: IntArray,
    corners: Corners,
    counts: IntArray,
    area: FloatArray,
    patch: IntArray,
    centroid: Points,
    moment: FloatArray,
    normals: FloatArray,
    axes: FloatArray,
    side_tolerance: float,
    tolerance: float,
    start: int,
    stop: int,
    exchange: FloatArray,
    position_p: FloatArray,
    position_q: FloatArray,
    residual_p: FloatArray,
    residual_q: FloatArray,
) -> None:
    """Exchange areas of pairs [start, stop), and how they vary over either end."""
    scratch = np.empty((2, 8, 3))
    for pair in range(start, stop):
        if kind[pair] == NONE:
            continue
        i = p[pair]
        j = q[pair]
        n1 = normals[patch[i]]
        n2 = normals[patch[j]]
        exchange[pair] = exchange_area(
            corners[i], counts[i], n1, area[i], corners[j], counts[j], n2, area[j], side_tolerance,
            tolerance, scratch,
        )  # fmt: skip
        if exchange[pair] <= 0.0:
            continue
        residual_p[pair] = form_factor_variation(
            corners[i], counts[i], n1, axes[patch[i]], centroid[i], moment[i], area[i], corners[j], counts[j],
            n2, area[j], centroid[j], exchange[pair], scratch[0], position_p[pair],
        )  # fmt: skip
        residual_q[pair] = form_factor_variation(
            corners[j], counts[j], n2, axes[patch[j]], centroid[j], moment[j], area[j], corners[i], counts[i],
            n1, area[i], centroid[i], exchange[pair], scratch[0], position_q[pair],
        )  # fmt: skip
