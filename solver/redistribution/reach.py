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
from solver.types import ByteArray, Corners, FloatArray, IntArray
from solver.visibility.bvh import build_hierarchy

_CHUNK: Final = 1 << 15


LEAVING: Final = 0
COMING: Final = 1
"""What a link's light may pass through: what is about to go, and what is about to come."""


def met_pairs(tree: ElementTree, boxes: tuple[FloatArray, FloatArray]) -> ByteArray:
    """1 in (2, p, p) where light between two patches may pass through boxes (k, 2, 3), LEAVING or COMING."""
    count = tree.patch_count
    met = np.zeros((2, count, count), dtype=np.uint8)
    corners = tree.corners[:count]
    h = build_hierarchy(corners, np.arange(count, dtype=np.int32))
    low, high = corners.min(axis=1), corners.max(axis=1)

    def work(start: int, stop: int) -> None:
        for kind in range(start, stop):
            for box in boxes[kind]:
                _reach_patches(
                    h.low, h.high, h.skip, h.first, h.count, h.order, low, high, box[0], box[1], met[kind]
                )

    run_chunks(work, len(boxes), 1)
    return met


def bounds_of(tree: ElementTree) -> FloatArray:
    """Bounding boxes (n, 2, 3) of elements, metres."""
    bounds = np.empty((len(tree), 2, 3))
    run_chunks(lambda start, stop: _bound(tree.corners, start, stop, bounds), len(tree), _CHUNK)
    return bounds


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
    met: ByteArray,
) -> None:
    """Mark the pairs (p, p) of patches whose hull meets a box, either way round."""
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
                        met[p, q] = 1
                        met[q, p] = 1
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
def _bound(corners: Corners, start: int, stop: int, bounds: FloatArray) -> None:
    for e in range(start, stop):
        for axis in range(3):
            low = high = corners[e, 0, axis]
            for k in range(1, 4):
                low = min(low, corners[e, k, axis])
                high = max(high, corners[e, k, axis])
            bounds[e, 0, axis] = low
            bounds[e, 1, axis] = high
