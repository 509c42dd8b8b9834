"""Which directed edges run along each other: a search by the vertex that an edge starts from."""

from __future__ import annotations

import numpy as np

from solver.illumination.meshing.ragged import by_group
from solver.kernels import kernel
from solver.types import IntArray


def opposite_edges(start: IntArray, end: IntArray, vertex_count: int) -> IntArray:
    """(m,) for each edge start -> end, the one that runs end -> start, or -1; no edge occurs twice."""
    opposite = np.empty(len(start), dtype=np.int32)
    _match(start, end, *by_group(start, vertex_count), opposite)
    return opposite


def edge_labels(
    a: IntArray, b: IntArray, label: IntArray, start: IntArray, end: IntArray, vertex_count: int
) -> IntArray:
    """(m,) for each edge start -> end, the least `label` of those between its ends a, b (k,), or -1."""
    # Labelled edges are looked for from their lower vertex.
    low = np.minimum(a, b)
    high = np.maximum(a, b)
    first, order = by_group(low, vertex_count)
    found = np.empty(len(start), dtype=np.int32)
    _look_up(first, order, high, label, start, end, found)
    return found


@kernel
def _match(start: IntArray, end: IntArray, first: IntArray, order: IntArray, opposite: IntArray) -> None:
    for edge in range(len(start)):
        opposite[edge] = -1
        for i in range(first[end[edge]], first[end[edge] + 1]):
            if end[order[i]] == start[edge]:
                opposite[edge] = order[i]


@kernel
def _look_up(
    first: IntArray,
    order: IntArray,
    high: IntArray,
    label: IntArray,
    start: IntArray,
    end: IntArray,
    found: IntArray,
) -> None:
    for edge in range(len(start)):
        low = min(start[edge], end[edge])
        far = max(start[edge], end[edge])
        found[edge] = -1
        for i in range(first[low], first[low + 1]):
            known = order[i]
            if high[known] == far and (found[edge] < 0 or label[known] < found[edge]):
                found[edge] = label[known]
