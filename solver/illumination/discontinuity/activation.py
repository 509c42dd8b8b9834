"""Active discontinuities: the strongest ones that the leaves can bear ([H 5.5.7]).

A discontinuity is in the triangulation of every leaf that it passes through, or in none: so two leaves
never differ in the vertices of their common border. From the strongest down, one is taken if it weighs
enough and no leaf on its way holds as many lines already as it may; those of one set count as one line.
Contacts weigh infinitely much, but count too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.illumination.discontinuity.leaf_crossings import LeafCrossings
from solver.illumination.discontinuity.sets import ActiveEdges, DiscontinuitySets
from solver.kernels import kernel
from solver.types import BoolArray, FloatArray, Int64Array, IntArray


@dataclass(frozen=True)
class ActivationStatistics:
    """What became of the discontinuities."""

    found: int
    active: int
    dropped_by_weight: int
    """Below the minimum weight"""
    dropped_by_limit: int
    """For some leaf on their way was full"""


@dataclass(frozen=True, eq=False)
class Activation:
    """What is active, and the edges that it makes."""

    active: BoolArray
    """(d,)"""
    edges: ActiveEdges
    statistics: ActivationStatistics


def activate(
    sets: DiscontinuitySets,
    crossings: LeafCrossings,
    weight: FloatArray,
    minimum_weight: float,
    max_leaf_discontinuities: int,
) -> Activation:
    """Activate the discontinuities of `sets` that weigh (d,) `minimum_weight` or more, strongest first.

    Weights and their minimum are of one unit; no leaf takes more than `max_leaf_discontinuities` sets,
    and none at all if that is 0.
    """
    d = len(sets.member)
    # Of equal weight, the longer one comes first.
    order = np.lexsort((sets.span[:, 0] - sets.span[:, 1], -weight))
    order = order[weight[order] >= minimum_weight]
    held = np.empty((crossings.leaf_count, max(1, max_leaf_discontinuities)), dtype=np.int32)
    active = np.zeros(d, dtype=np.bool_)
    _activate(order, sets.member, crossings.start, crossings.leaf, max_leaf_discontinuities, held, active)
    taken = int(np.count_nonzero(active))
    statistics = ActivationStatistics(d, taken, d - len(order), len(order) - taken)
    return Activation(active, sets.edges(active), statistics)


@kernel
def _holds(held: IntArray, used: IntArray, leaf: int, line: int) -> bool:
    """Whether a leaf holds a set."""
    found = False
    for k in range(used[leaf]):
        found = found or held[leaf, k] == line
    return found


@kernel
def _activate(
    order: Int64Array,
    member: IntArray,
    start: Int64Array,
    leaf: IntArray,
    limit: int,
    held: IntArray,
    active: BoolArray,
) -> None:
    """Take discontinuities in their order, while the leaves on their way have room; held (n, limit) sets."""
    used = np.zeros(len(held), dtype=np.int32)
    for i in order:
        fits = True
        for entry in range(start[i], start[i + 1]):
            there = leaf[entry]
            if used[there] >= limit and not _holds(held, used, there, member[i]):
                fits = False
                break
        if not fits:
            continue
        active[i] = True
        for entry in range(start[i], start[i + 1]):
            there = leaf[entry]
            if not _holds(held, used, there, member[i]):
                held[there, used[there]] = member[i]
                used[there] += 1
