"""The blockers of a pair of elements: found in the hierarchy once, then handed down ([H 4.1]).

Top-level pairs ask the hierarchy for the polygons that reach into their shaft; pairs of children look
only at what blocked their parents.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.types import BoolArray, ByteArray, Corners, FloatArray, Int64Array, IntArray
from solver.visibility.bvh import walk_hierarchy
from solver.visibility.culling import BLOCK, LANES, MAY_COVER, OUTSIDE, cull_block, gather_blocks
from solver.visibility.shafts import FULL, MAX_PLANES, NONE, PARTIAL, covers, shaft_planes

UNCHANGED: Final = 3
UNKNOWN: Final = 4
"""What `renewed_blockers` says beside FULL, PARTIAL and NONE."""


@kernel
def first_blockers(
    pair_p: IntArray,
    pair_q: IntArray,
    element_corners: Corners,
    element_counts: IntArray,
    patch: IntArray,
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
    """Blockers of pairs [start, stop) of elements, patches appended to `pool`; returns the pool's use.

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
            element_corners[p], element_counts[p], normals[patch[p]], element_corners[q], element_counts[q],
            normals[patch[q]], planes,
        )  # fmt: skip
        found = walk_hierarchy(
            low, high, skip, leaf_first, leaf_count, order, planes, plane_count, tolerance, candidates
        )
        if used + found > len(pool):
            return -1 - (pair - start)
        gather_blocks(corners, normals, candidates, 0, found, blocks)
        visibility[pair], blocker_count[pair] = _cull(
            corners, counts, normals, patch[p], patch[q], element_corners[p], element_counts[p],
            element_corners[q], element_counts[q], planes, plane_count, candidates, 0, found, blocks,
            tolerance, work, verdict, pool, used,
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


@kernel
def renewed_blockers(
    pair_p: IntArray,
    pair_q: IntArray,
    before: IntArray,
    element_corners: Corners,
    element_counts: IntArray,
    patch: IntArray,
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
    list_start: Int64Array,
    list_count: IntArray,
    lists: IntArray,
    recent: BoolArray,
    start: int,
    stop: int,
    room: Int64Array,
    visibility: IntArray,
    blocker_count: IntArray,
    pool: IntArray,
) -> None:
    """Blockers of pairs [start, stop) of elements, from those known before some patches came or went.

    Patches that went are -1 in the lists; those that came are `recent`, and in the hierarchy. `before` is the
    visibility class that was. Writes the class, UNCHANGED where nothing is different, or UNKNOWN where what
    hid the pair entirely is gone, so that the other blockers are not known; and the lists where they are
    different, to pool[room[pair]:].
    """
    planes = np.empty((MAX_PLANES, 4))
    candidates = np.empty(len(order), dtype=np.int32)
    blocks = np.empty((len(order) + LANES - 1) // LANES * BLOCK)
    work = np.empty(5 * LANES)
    verdict = np.empty(LANES, dtype=np.uint8)
    for pair in range(start, stop):
        p = pair_p[pair]
        q = pair_q[pair]
        kept = 0
        for k in range(list_start[pair], list_start[pair] + list_count[pair]):
            if lists[k] >= 0 and not recent[lists[k]]:
                pool[room[pair] + kept] = lists[k]
                kept += 1
        lost = kept < list_count[pair]
        if before[pair] == NONE:
            visibility[pair] = UNKNOWN if lost else UNCHANGED
            continue
        plane_count = shaft_planes(
            element_corners[p], element_counts[p], normals[patch[p]], element_corners[q], element_counts[q],
            normals[patch[q]], planes,
        )  # fmt: skip
        found = walk_hierarchy(
            low, high, skip, leaf_first, leaf_count, order, planes, plane_count, tolerance, candidates
        )
        gather_blocks(corners, normals, candidates, 0, found, blocks)
        kind, added = _cull(
            corners, counts, normals, patch[p], patch[q], element_corners[p], element_counts[p],
            element_corners[q], element_counts[q], planes, plane_count, candidates, 0, found, blocks,
            tolerance, work, verdict, pool, room[pair] + kept,
        )  # fmt: skip
        if kind == NONE:
            pool[room[pair]] = pool[room[pair] + kept]
            visibility[pair] = NONE
            blocker_count[pair] = 1
        elif added == 0 and not lost:
            visibility[pair] = UNCHANGED
        else:
            visibility[pair] = FULL if kept + added == 0 else PARTIAL
            blocker_count[pair] = kept + added
