"""Whether the light of a link passes where something was or is ([G "Finding the patches in shadow"]).

The paper builds a shadow volume for each patch that shoots. Here the volume of a link is the hull of the
boxes around its two ends; whether another box meets it is told in some nanoseconds, so that all links are
looked through. Boxes are larger than what they hold: too many links may be found, and none is missed.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.parallel import run_chunks
from solver.transport.elements import ElementTree
from solver.types import Corners, FloatArray, IntArray

_CHUNK: Final = 1 << 15


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
    for axis in range(3):
        if max(a_high[axis], b_high[axis]) < low[axis] or min(a_low[axis], b_low[axis]) > high[axis]:
            return False
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
def _bound(corners: Corners, start: int, stop: int, bounds: FloatArray) -> None:
    for e in range(start, stop):
        for axis in range(3):
            low = high = corners[e, 0, axis]
            for k in range(1, 4):
                low = min(low, corners[e, k, axis])
                high = max(high, corners[e, k, axis])
            bounds[e, 0, axis] = low
            bounds[e, 1, axis] = high
