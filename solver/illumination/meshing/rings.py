"""The rings around cells: their outlines with the points that rails have got."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.illumination.meshing.rails import RailPoints, sort_along
from solver.illumination.meshing.skeleton import Skeleton
from solver.kernels import kernel
from solver.types import BoolArray, FloatArray, IntArray, Points


@dataclass(frozen=True, eq=False)
class Rings:
    """The rings of n cells: l stops, each with the stretch from it to the next."""

    start: IntArray
    """(n + 1,) where each cell's ring begins, at its corner 0"""
    stop: IntArray
    """(l,) a node k < b of the skeleton, or b + i for point i"""
    piece: IntArray
    """(l,) piece of the skeleton that the stretch is part of"""
    low: FloatArray
    """(l,) where the stretch starts on the piece's rail"""
    high: FloatArray
    """(l,) where it ends there"""
    position: Points
    """(b + k, 3) metres, by stop"""


def trace_rings(skeleton: Skeleton, points: RailPoints) -> Rings:
    """The rings of all cells of `skeleton`."""
    m = len(skeleton.node)
    first, order = sort_along(points.rail, points.fraction, m)
    total = m + int(np.diff(first)[skeleton.rail].sum())
    start = np.empty(skeleton.cell_count + 1, dtype=np.int32)
    stop, piece = np.empty(total, dtype=np.int32), np.empty(total, dtype=np.int32)
    low, high = np.empty(total), np.empty(total)
    _trace(
        skeleton.start, skeleton.node, skeleton.rail, skeleton.forward, first, order, points.fraction,
        len(skeleton.position), start, stop, piece, low, high,
    )  # fmt: skip
    return Rings(
        start=start,
        stop=stop,
        piece=piece,
        low=low,
        high=high,
        position=np.concatenate([skeleton.position, points.position(skeleton)]),
    )


@kernel
def _trace(
    start: IntArray,
    node: IntArray,
    rail: IntArray,
    forward: BoolArray,
    first: IntArray,
    order: IntArray,
    fraction: FloatArray,
    node_count: int,
    ring_start: IntArray,
    stop: IntArray,
    piece: IntArray,
    low: FloatArray,
    high: FloatArray,
) -> None:
    at = 0
    for cell in range(len(start) - 1):
        ring_start[cell] = at
        for i in range(start[cell], start[cell + 1]):
            begin = first[rail[i]]
            count = first[rail[i] + 1] - begin
            stop[at] = node[i]
            piece[at] = i
            low[at] = 0.0 if forward[i] else 1.0
            for j in range(count):
                point = order[begin + j] if forward[i] else order[begin + count - 1 - j]
                high[at] = fraction[point]
                at += 1
                stop[at] = node_count + point
                piece[at] = i
                low[at] = fraction[point]
            high[at] = 1.0 if forward[i] else 0.0
            at += 1
    ring_start[len(start) - 1] = at
