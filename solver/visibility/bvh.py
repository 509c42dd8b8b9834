"""A bounding volume hierarchy over polygons, as flat arrays that kernels walk without a stack.

Nodes stand in depth-first order; `skip` is the node to go on with when a node's box is missed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.types import Corners, FloatArray, IntArray

LEAF_SIZE: Final = 4


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """m nodes over n polygons."""

    low: FloatArray
    """(m, 3) lower corner of each node's box"""
    high: FloatArray
    """(m, 3) upper corner"""
    skip: IntArray
    """(m,) next node in depth-first order that is not below this one; m at the end"""
    first: IntArray
    """(m,) first position in `order` of a leaf, -1 for an inner node"""
    count: IntArray
    """(m,) polygons of a leaf"""
    order: IntArray
    """(n,) polygon indices, leaf by leaf"""


def build_hierarchy(corners: Corners, members: IntArray) -> Hierarchy:
    """Hierarchy over the polygons `corners[members]`, split at the median of the longest side."""
    low = corners[members].min(axis=1) if len(members) else np.empty((0, 3))
    high = corners[members].max(axis=1) if len(members) else np.empty((0, 3))
    capacity = max(1, 2 * len(members))
    node_low, node_high = np.zeros((capacity, 3)), np.zeros((capacity, 3))
    skip = np.zeros(capacity, dtype=np.int32)
    first = np.full(capacity, -1, dtype=np.int32)
    count = np.zeros(capacity, dtype=np.int32)
    order = np.arange(len(members), dtype=np.int32)
    used = _build(low, high, order, node_low, node_high, skip, first, count) if len(members) else 0
    return Hierarchy(
        node_low[:used].copy(),
        node_high[:used].copy(),
        skip[:used].copy(),
        first[:used].copy(),
        count[:used].copy(),
        members[order].astype(np.int32),
    )


@kernel
def _build(
    low: FloatArray,
    high: FloatArray,
    order: IntArray,
    node_low: FloatArray,
    node_high: FloatArray,
    skip: IntArray,
    first: IntArray,
    count: IntArray,
) -> int:
    """Fill the node arrays; returns how many nodes there are."""
    stack = np.empty((128, 3), dtype=np.int32)
    stack[0, 0] = 0
    stack[0, 1] = len(order)
    stack[0, 2] = 0
    depth_top = 1
    used = 0
    # Each entry is a range of `order`; nodes are numbered as they are popped, which is depth first.
    end_of = np.empty(2 * len(order) + 1, dtype=np.int32)
    while depth_top > 0:
        depth_top -= 1
        start = stack[depth_top, 0]
        stop = stack[depth_top, 1]
        node = used
        used += 1
        for axis in range(3):
            node_low[node, axis] = np.inf
            node_high[node, axis] = -np.inf
        for k in range(start, stop):
            for axis in range(3):
                node_low[node, axis] = min(node_low[node, axis], low[order[k], axis])
                node_high[node, axis] = max(node_high[node, axis], high[order[k], axis])
        end_of[node] = stop
        if stop - start <= LEAF_SIZE:
            first[node] = start
            count[node] = stop - start
            continue
        widest = 0
        for axis in range(1, 3):
            if (
                node_high[node, axis] - node_low[node, axis]
                > node_high[node, widest] - node_low[node, widest]
            ):
                widest = axis
        keys = np.empty(stop - start)
        for k in range(start, stop):
            keys[k - start] = low[order[k], widest] + high[order[k], widest]
        rank = np.argsort(keys, kind="mergesort")
        moved = order[start:stop].copy()
        for k in range(stop - start):
            order[start + k] = moved[rank[k]]
        middle = (start + stop) // 2
        stack[depth_top, 0] = middle
        stack[depth_top, 1] = stop
        depth_top += 1
        stack[depth_top, 0] = start
        stack[depth_top, 1] = middle
        depth_top += 1
    # In depth-first order the next node outside a subtree is the first later one that starts where
    # the subtree's range ends.
    for node in range(used):
        after = node + 1
        if first[node] < 0:
            while after < used and end_of[after] <= end_of[node]:
                after += 1
        skip[node] = after
    return used


@kernel
def walk_hierarchy(
    low: FloatArray,
    high: FloatArray,
    skip: IntArray,
    leaf_first: IntArray,
    leaf_count: IntArray,
    order: IntArray,
    planes: FloatArray,
    plane_count: int,
    tolerance: float,
    out: IntArray,
) -> int:
    """Polygons in leaves whose box reaches into the shaft, into `out`; returns their number."""
    found = 0
    node = 0
    while node < len(skip):
        missed = False
        for p in range(plane_count):
            # The box corner furthest along the plane's normal decides.
            reach = 0.0
            for axis in range(3):
                c = planes[p, axis]
                reach += c * (high[node, axis] if c > 0.0 else low[node, axis])
            if reach - planes[p, 3] <= tolerance:
                missed = True
                break
        if missed:
            node = skip[node]
            continue
        if leaf_first[node] >= 0:
            for k in range(leaf_first[node], leaf_first[node] + leaf_count[node]):
                out[found] = order[k]
                found += 1
        node += 1
    return found
