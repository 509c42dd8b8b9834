"""The blockers of a pair of elements: found in the hierarchy once, then handed down ([H 4.1]).

Top-level pairs ask the hierarchy for the polygons that reach into their shaft; pairs of children look
only at what blocked their parents.
"""

from __future__ import annotations

import numpy as np

from solver.kernels import kernel
from solver.types import ByteArray, Corners, FloatArray, IntArray
from solver.visibility.bvh import walk_hierarchy
from solver.visibility.culling import BLOCK, LANES, MAY_COVER, OUTSIDE, cull_block
from solver.visibility.shafts import FULL, MAX_PLANES, NONE, PARTIAL, can_block, covers, shaft_planes

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
    parents: IntArray,
    parent_start: int,
    parent_count: int,
    blocks: FloatArray,
    tolerance: float,
    planes: FloatArray,
    work: FloatArray,
    verdict: ByteArray,
    out: IntArray,
    used: int,
) -> tuple[int, int]:
    """Which of the parent link's blockers still block a child pair: (visibility, number kept).

    The kept ones are written to out[used:]. corners, counts, normals are the patches'; `blocks` holds the
    parent's blockers as `gather_blocks` lays them out.
    """
    plane_count = shaft_planes(first, n1, normal1, second, n2, normal2, planes)
    kept = 0
    for block in range(0, parent_count, LANES):
        n = min(LANES, parent_count - block)
        lanes = blocks[block // LANES * BLOCK : (block // LANES + 1) * BLOCK]
        cull_block(lanes, n, first, second, planes, plane_count, tolerance, work, verdict)
        for k in range(n):
            if verdict[k] == OUTSIDE:
                continue
            b = parents[parent_start + block + k]
            if verdict[k] == MAY_COVER and covers(
                corners[b], counts[b], normals[b], first, n1, second, n2, tolerance
            ):
                out[used] = b
                return NONE, 1
            out[used + kept] = b
            kept += 1
    return (FULL if kept == 0 else PARTIAL), kept
