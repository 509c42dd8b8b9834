"""The blockers of a pair of elements: found in the hierarchy once, then handed down ([H 4.1]).

Top-level pairs ask the hierarchy for the polygons that reach into their shaft; pairs of children look
only at what blocked their parents.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.types import Corners, FloatArray, IntArray
from solver.visibility.bvh import walk_hierarchy
from solver.visibility.shafts import FULL, MAX_PLANES, NONE, PARTIAL, can_block, covers, shaft_planes

MANY: Final = 48
"""A list longer than this is culled by spheres alone."""


@kernel
def first_blockers(
    pair_p: IntArray,
    pair_q: IntArray,
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    spheres: FloatArray,
    low: FloatArray,
    high: FloatArray,
    skip: IntArray,
    leaf_first: IntArray,
    leaf_count: IntArray,
    order: IntArray,
    tolerance: float,
    start: int,
    stop: int,
    visibility: IntArray,
    blocker_count: IntArray,
    pool: IntArray,
) -> int:
    """Blockers of top-level pairs [start, stop) of patches, appended to `pool`; returns the pool's use.

    Writes visibility (FULL, PARTIAL, NONE) and blocker_count per pair. If the pool is too small the
    return value is -1 - (pairs done): call again from there with a fresh pool.
    """
    planes = np.empty((MAX_PLANES, 4))
    candidates = np.empty(len(order), dtype=np.int32)
    used = 0
    for pair in range(start, stop):
        p = pair_p[pair]
        q = pair_q[pair]
        plane_count = shaft_planes(
            corners[p], counts[p], normals[p], corners[q], counts[q], normals[q], planes
        )
        found = walk_hierarchy(
            low, high, skip, leaf_first, leaf_count, order, planes, plane_count, tolerance, candidates
        )
        if used + found > len(pool):
            return -1 - (pair - start)
        kept = 0
        hidden = False
        for k in range(found):
            b = candidates[k]
            if b in (p, q):
                continue
            if not can_block(
                corners[b], counts[b], normals[b], spheres[b], corners[p], counts[p], corners[q], counts[q],
                planes, plane_count, tolerance,
            ):  # fmt: skip
                continue
            pool[used + kept] = b
            kept += 1
            if not hidden and covers(
                corners[b], counts[b], normals[b], corners[p], counts[p], corners[q], counts[q], tolerance
            ):
                hidden = True
                pool[used] = b
                kept = 1
                break
        visibility[pair] = NONE if hidden else (FULL if kept == 0 else PARTIAL)
        blocker_count[pair] = kept
        used += kept
    return used


@kernel
def inherited_blockers(
    first: FloatArray,
    n1: int,
    normal1: FloatArray,
    second: FloatArray,
    n2: int,
    normal2: FloatArray,
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    spheres: FloatArray,
    parents: IntArray,
    parent_start: int,
    parent_count: int,
    tolerance: float,
    planes: FloatArray,
    out: IntArray,
    used: int,
) -> tuple[int, int]:
    """Which of the parent link's blockers still block a child pair: (visibility, number kept).

    The kept ones are written to out[used:]; of a long list those whose sphere reaches into the shaft are
    kept, which is more than need be and sooner done. corners, counts, normals, spheres are the patches'.
    """
    plane_count = shaft_planes(first, n1, normal1, second, n2, normal2, planes)
    by_sphere = parent_count > MANY
    culled_by = 0
    kept = 0
    for k in range(parent_start, parent_start + parent_count):
        b = parents[k]
        if by_sphere:
            # The plane that culled the last one is likely to cull its neighbour.
            if _is_outside(spheres[b], planes[culled_by], tolerance):
                continue
            outside = False
            for p in range(plane_count):
                if _is_outside(spheres[b], planes[p], tolerance):
                    culled_by = p
                    outside = True
                    break
            if outside:
                continue
        elif not can_block(
            corners[b], counts[b], normals[b], spheres[b], first, n1, second, n2, planes, plane_count,
            tolerance,
        ):  # fmt: skip
            continue
        if covers(corners[b], counts[b], normals[b], first, n1, second, n2, tolerance):
            out[used] = b
            return NONE, 1
        out[used + kept] = b
        kept += 1
    return (FULL if kept == 0 else PARTIAL), kept


@kernel
def _is_outside(sphere: FloatArray, plane: FloatArray, tolerance: float) -> bool:
    """Whether a sphere (4,) lies behind a plane (4,)."""
    height = plane[0] * sphere[0] + plane[1] * sphere[1] + plane[2] * sphere[2] - plane[3]
    return bool(height + sphere[3] <= tolerance)
