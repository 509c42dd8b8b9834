"""Groups of rows that agree, found by sorting: union-find over neighbours in several orders."""

from __future__ import annotations

from solver.kernels import kernel
from solver.types import BoolArray, Int64Array, IntArray


@kernel
def unite(order: Int64Array, differs: BoolArray, label: IntArray) -> None:
    """Union-find: rows that follow each other in `order` and do not differ are one group."""
    for i in range(len(differs)):
        if differs[i]:
            continue
        a = order[i]
        b = order[i + 1]
        while label[a] != a:
            a = label[a]
        while label[b] != b:
            b = label[b]
        label[max(a, b)] = min(a, b)


@kernel
def settle(label: IntArray) -> None:
    """Every label becomes its root: labels never exceed their row's index."""
    for i in range(len(label)):
        label[i] = label[label[i]]
