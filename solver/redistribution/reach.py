"""The links whose light passes where something was or is ([G "Finding the patches in shadow"]).

The paper builds a shadow volume for each patch that shoots. Here the volume of a pair is the hull of the
boxes around its two ends. Pairs of patches are found by descending a hierarchy of boxes from both ends at
once, and among their links only are elements looked at. Boxes are larger than what they hold, so that too
many links may be found, and none is missed.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.parallel import run_chunks
from solver.transport.elements import ElementTree
from solver.transport.links import LinkTable
from solver.types import ByteArray, Corners, FloatArray, IntArray
from solver.visibility.bvh import build_hierarchy

_CHUNK: Final = 1 << 15


LEAVING: Final = 1
COMING: Final = 2
"""What a link's light may pass through: what is about to go, and what is about to come."""


def reached_links(
    tree: ElementTree, links: LinkTable, leaving: FloatArray, coming: FloatArray, margin: float
) -> ByteArray:
    """For each link (n,) which boxes its light may pass through, as a sum of LEAVING and COMING.

    Boxes (k, 2, 3) are grown by `margin` metres.
    """
    count = tree.patch_count
    met = np.zeros((count, count), dtype=np.uint8)
    corners = tree.corners[:count]
    hierarchy = build_hierarchy(corners, np.arange(count, dtype=np.int32))
    low, high = corners.min(axis=1), corners.max(axis=1)
    boxes = np.concatenate([leaving, coming])
    kind = np.repeat(np.array([LEAVING, COMING], dtype=np.uint8), [len(leaving), len(coming)])
    boxes[:, 0] -= margin
    boxes[:, 1] += margin
    for box, bit in zip(boxes, kind, strict=True):
        _reach_patches(
            hierarchy.low, hierarchy.high, hierarchy.skip, hierarchy.first, hierarchy.count, hierarchy.order,
            low, high, box[0], box[1], int(bit), met,
        )  # fmt: skip
    found = np.zeros(len(links), dtype=np.uint8)

    def work(start: int, stop: int) -> None:
        _reach_links(links.p, links.q, tree.patch, tree.corners, met, boxes, kind, start, stop, found)

    run_chunks(work, len(links), _CHUNK)
    return found


def boxes_around(corners: Corners, owner: IntArray) -> FloatArray:
    """A box (n, 2, 3) around the patches (p, 4, 3) of each of n owners (p,)."""
    order = np.argsort(owner, kind="stable")
    start = np.flatnonzero(np.diff(owner[order], prepend=-1))
    if len(order) == 0:
        return np.empty((0, 2, 3))
    low = np.minimum.reduceat(corners[order].min(axis=1), start)
    high = np.maximum.reduceat(corners[order].max(axis=1), start)
    return np.stack([low, high], axis=1)


@inline_kernel
def hull_meets(
    a_low: FloatArray,
    a_high: FloatArray,
    b_low: FloatArray,
    b_high: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> bool:
    """Whether the hull of two boxes meets a third one.

    The hull is swept by the box that goes from the one to the other, bounds and all, at an even pace: is it
    at the third at any time from 0 to 1?
    """
    begin = 0.0
    end = 1.0
    for axis in range(3):
        # a_low + t (b_low - a_low) <= high, and the same for the upper bounds the other way round.
        for side in range(2):
            if side == 0:
                slope = b_low[axis] - a_low[axis]
                room = high[axis] - a_low[axis]
            else:
                slope = a_high[axis] - b_high[axis]
                room = a_high[axis] - low[axis]
            if slope == 0.0:
                if room < 0.0:
                    return False
            elif slope > 0.0:
                end = min(end, room / slope)
            else:
                begin = max(begin, room / slope)
        if begin > end:
            return False
    return True


@kernel
def _reach_patches(
    low: FloatArray,
    high: FloatArray,
    skip: IntArray,
    leaf_first: IntArray,
    leaf_count: IntArray,
    order: IntArray,
    patch_low: FloatArray,
    patch_high: FloatArray,
    box_low: FloatArray,
    box_high: FloatArray,
    bit: int,
    met: ByteArray,
) -> None:
    """Mark the pairs (p, p) of patches whose hull meets a box by `bit`, either way round."""
    if len(skip) == 0:
        return
    stack = np.empty((4096, 2), dtype=np.int32)
    stack[0, 0] = 0
    stack[0, 1] = 0
    top = 1
    while top > 0:
        top -= 1
        a = stack[top, 0]
        b = stack[top, 1]
        if not hull_meets(low[a], high[a], low[b], high[b], box_low, box_high):
            continue
        if leaf_first[a] >= 0 and leaf_first[b] >= 0:
            for i in range(leaf_first[a], leaf_first[a] + leaf_count[a]):
                for j in range(leaf_first[b], leaf_first[b] + leaf_count[b]):
                    p = order[i]
                    q = order[j]
                    if hull_meets(
                        patch_low[p], patch_high[p], patch_low[q], patch_high[q], box_low, box_high
                    ):
                        met[p, q] |= bit
                        met[q, p] |= bit
            continue
        if a == b:
            first = a + 1
            second = skip[first]
            stack[top, 0] = first
            stack[top, 1] = first
            stack[top + 1, 0] = second
            stack[top + 1, 1] = second
            stack[top + 2, 0] = first
            stack[top + 2, 1] = second
            top += 3
            continue
        # Into the larger one of the two.
        a_size = 0.0
        b_size = 0.0
        for axis in range(3):
            a_size += high[a, axis] - low[a, axis]
            b_size += high[b, axis] - low[b, axis]
        if leaf_first[b] >= 0 or (leaf_first[a] < 0 and a_size >= b_size):
            stack[top, 0] = a + 1
            stack[top, 1] = b
            stack[top + 1, 0] = skip[a + 1]
            stack[top + 1, 1] = b
        else:
            stack[top, 0] = a
            stack[top, 1] = b + 1
            stack[top + 1, 0] = a
            stack[top + 1, 1] = skip[b + 1]
        top += 2


@kernel
def _reach_links(
    p: IntArray,
    q: IntArray,
    patch: IntArray,
    corners: Corners,
    met: ByteArray,
    boxes: FloatArray,
    kind: ByteArray,
    start: int,
    stop: int,
    found: ByteArray,
) -> None:
    bounds = np.empty((4, 3))
    for link in range(start, stop):
        i = p[link]
        j = q[link]
        possible = met[patch[i], patch[j]]
        if possible == 0:
            continue
        for axis in range(3):
            bounds[0, axis] = bounds[1, axis] = corners[i, 0, axis]
            bounds[2, axis] = bounds[3, axis] = corners[j, 0, axis]
            for k in range(1, 4):
                bounds[0, axis] = min(bounds[0, axis], corners[i, k, axis])
                bounds[1, axis] = max(bounds[1, axis], corners[i, k, axis])
                bounds[2, axis] = min(bounds[2, axis], corners[j, k, axis])
                bounds[3, axis] = max(bounds[3, axis], corners[j, k, axis])
        for box in range(len(boxes)):
            if (
                possible & kind[box]
                and not found[link] & kind[box]
                and hull_meets(bounds[0], bounds[1], bounds[2], bounds[3], boxes[box, 0], boxes[box, 1])
            ):
                found[link] |= kind[box]
