"""Rows that belong to groups, group by group: where each group's begin, and which rows some groups have."""

from __future__ import annotations

import numpy as np

from solver.kernels import kernel
from solver.types import AnyArray, Int64Array, IntArray


def starts(group: IntArray, count: int) -> IntArray:
    """(count + 1,) where each group's rows begin among rows that are sorted by `group`."""
    return starts_of(np.bincount(group, minlength=count))


def starts_of(lengths: AnyArray) -> IntArray:
    """(n + 1,) where each of n groups begins that have `lengths` (n,) rows."""
    start = np.zeros(len(lengths) + 1, dtype=np.int32)
    np.cumsum(lengths, out=start[1:])
    return start


def spread(first: AnyArray, lengths: AnyArray) -> Int64Array:
    """The rows first, first + 1, ... of each group, which has `lengths` (n,) of them, group by group."""
    ends = np.cumsum(lengths, dtype=np.int64)
    rows: Int64Array = np.arange(ends[-1] if len(ends) else 0, dtype=np.int64)
    return rows + np.repeat(first - (ends - lengths), lengths)


def by_group(group: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Where the rows of each group begin (count + 1,), and which they are (n,), of rows in any order (n,).

    Those of one group keep theirs.
    """
    first = np.zeros(count + 1, dtype=np.int32)
    order = np.empty(len(group), dtype=np.int32)
    _sort(group, first, order)
    return first, order


@kernel
def _sort(group: IntArray, first: IntArray, order: IntArray) -> None:
    for row in range(len(group)):
        first[group[row] + 1] += 1
    for g in range(len(first) - 1):
        first[g + 1] += first[g]
    # Moved on by one, each is the place of the next row, and after the last row the end of its group.
    for g in range(len(first) - 1, 0, -1):
        first[g] = first[g - 1]
    for row in range(len(group)):
        g = group[row]
        order[first[g + 1]] = row
        first[g + 1] += 1
