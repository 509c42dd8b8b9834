"""Points that are added to rails: nodes of every cell along them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.illumination.meshing.ragged import by_group
from solver.illumination.meshing.skeleton import MINIMUM_LENGTH, Skeleton
from solver.kernels import kernel
from solver.types import FloatArray, IntArray, Points

APART: Final = 2.0 * MINIMUM_LENGTH
"""Part of a rail's length that lies between points at least."""


@dataclass(frozen=True, eq=False)
class RailPoints:
    """k points on rails; any two of a rail are `APART` apart at least, and that far from its ends."""

    rail: IntArray
    """(k,)"""
    fraction: FloatArray
    """(k,) where on the rail, in (0, 1)"""

    @classmethod
    def none(cls) -> RailPoints:
        """No points."""
        return cls(np.empty(0, dtype=np.int32), np.empty(0))

    def position(self, skeleton: Skeleton) -> Points:
        """(k, 3) metres: the same for all patches that meet there."""
        a = skeleton.position[skeleton.node[self.rail]]
        b = skeleton.position[skeleton.end[self.rail]]
        return np.asarray(a + self.fraction[:, None] * (b - a))


def add_points(points: RailPoints, rail: IntArray, fraction: FloatArray) -> tuple[RailPoints, IntArray]:
    """`points` with those at `fraction` (j,) of `rail` (j,) behind them, and which point each became (j,).

    The new ones are `APART` from both ends at least. What is nearer than that to another point
    becomes that point; those that were there before stay where they are, all of them.
    """
    known = len(points.rail)
    rails = np.concatenate([points.rail, rail])
    fractions = np.concatenate([points.fraction, fraction])
    _, order = sort_along(rails, fractions, int(rails.max(initial=-1)) + 1)
    point = np.full(len(rails), -1, dtype=np.int32)
    point[:known] = np.arange(known, dtype=np.int32)
    source = np.empty(len(rail), dtype=np.int32)
    added = _accept(order, known, rails, fractions, point, source)
    kept = np.concatenate([np.arange(known, dtype=np.int32), source[:added]])
    return RailPoints(rails[kept], fractions[kept]), point[known:]


def sort_along(rail: IntArray, fraction: FloatArray, count: int) -> tuple[IntArray, IntArray]:
    """Where the points of each of `count` rails begin (count + 1,), and which they are, along it (k,)."""
    first, order = by_group(rail, count)
    _sort_each(first, order, fraction)
    return first, order


@kernel
def _sort_each(first: IntArray, order: IntArray, fraction: FloatArray) -> None:
    """By insertion: a rail has few points."""
    for rail in range(len(first) - 1):
        for i in range(first[rail] + 1, first[rail + 1]):
            held = order[i]
            j = i
            while j > first[rail] and fraction[order[j - 1]] > fraction[held]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = held


@kernel
def _accept(
    order: IntArray,
    known: int,
    rail: IntArray,
    fraction: FloatArray,
    point: IntArray,
    source: IntArray,
) -> int:
    """Number the points in their order along the rails; those that are too near get the other's number."""
    added = 0
    before = -1
    for place in range(len(order)):
        i = order[place]
        if i >= known:
            # The next of those that were there before, and the last that was accepted.
            after = place + 1
            while after < len(order) and rail[order[after]] == rail[i] and order[after] >= known:
                after += 1
            near_before = before >= 0 and rail[before] == rail[i] and fraction[i] - fraction[before] < APART
            near_after = (
                after < len(order)
                and rail[order[after]] == rail[i]
                and fraction[order[after]] - fraction[i] < APART
            )
            if near_before:
                point[i] = point[before]
                continue
            if near_after:
                point[i] = point[order[after]]
                continue
            point[i] = known + added
            source[added] = i
            added += 1
        before = i
    return added
