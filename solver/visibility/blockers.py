"""The blockers of a pair of elements: found in the hierarchy once, then handed down ([H 4.1]).

Top-level pairs ask the hierarchy for the polygons that reach into their shaft; pairs of children look
only at what blocked their parents.
"""

from __future__ import annotations

import numpy as np

from solver.kernels import kernel
from solver.types import ByteArray, Corners, FloatArray, IntArray
from solver.visibility.bvh import walk_hierarchy
from solver.visibility.culling import BLOCK, LANES, MAY_COVER, OUTSIDE, cull_block, gather_blocks
from solver.visibility.shafts import FULL, MAX_PLANES, NONE, PARTIAL, covers, shaft_planes


@kernel
def first_blockers(
    pair_p: IntArray,
    pair_q: IntArray,
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
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
    blocks = np.empty((len(order) + LANES - 1) // LANES * BLOCK)
    work = np.empty(5 * LANES)
    verdict = np.empty(LANES, dtype=np.uint8)
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
        gather_blocks(corners, normals, candidates, 0, found, blocks)
        visibility[pair], blocker_count[pair] = _cull(
            corners, counts, normals, p, q, corners[p], counts[p], corners[q], counts[q], planes,
            plane_count, candidates, 0, found, blocks, tolerance, work, verdict, pool, used,
        )  # fmt: skip
        used += blocker_count[pair]
    return used


@kernel
def _cull(
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    p: int,
    q: int,
    first: FloatArray,
    n1: int,
    second: FloatArray,
    n2: int,
    planes: FloatArray,
    plane_count: int,
    candidates: IntArray,
    start: int,
    count: int,
    blocks: FloatArray,
    tolerance: float,
    work: FloatArray,
    verdict: ByteArray,
    out: IntArray,
    used: int,
) -> tuple[int, int]:
    """Which of the patches candidates[start : start + count], but p and q, block a pair of elements.

    `blocks` holds them as `gather_blocks` lays them out. Returns the visibility class and the number of
    blockers, which are written to out[used:].
    """
    kept = 0
    for block in range(0, count, LANES):
        n = min(LANES, count - block)
        lanes = blocks[block // LANES * BLOCK : (block // LANES + 1) * BLOCK]
        cull_block(lanes, n, first, second, planes, plane_count, tolerance, work, verdict)
        for k in range(n):
            if verdict[k] == OUTSIDE:
                continue
            b = candidates[start + block + k]
            if b in (p, q):
                continue
            if verdict[k] == MAY_COVER and covers(
                corners[b], counts[b], normals[b], first, n1, second, n2, tolerance
            ):
                out[used] = b
                return NONE, 1
            out[used + kept] = b
            kept += 1
    return (FULL if kept == 0 else PARTIAL), kept


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
    return _cull(
        corners, counts, normals, -1, -1, first, n1, second, n2, planes, plane_count, parents, parent_start,
        parent_count, blocks, tolerance, work, verdict, out, used,
    )  # fmt: skip
