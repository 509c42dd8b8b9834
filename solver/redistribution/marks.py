"""Marks on links that stay with them while others come and go."""

from __future__ import annotations

import numpy as np

from solver.types import IntArray


class Marks:
    """Rows of a link table that are marked."""

    def __init__(self) -> None:
        """None are."""
        self._marked = np.zeros(0, dtype=np.bool_)

    @staticmethod
    def of(rows: IntArray) -> Marks:
        """Those of `rows` (n,)."""
        marks = Marks()
        marks.mark(rows)
        return marks

    def rows(self) -> IntArray:
        """The marked rows, ascending."""
        return np.flatnonzero(self._marked).astype(np.int32)

    def mark(self, rows: IntArray) -> None:
        """Mark `rows` (n,), too."""
        if len(rows):
            self._reach(int(rows.max()) + 1)
            self._marked[rows] = True

    def replace(self, gone: IntArray, moved: IntArray, count: int) -> None:
        """Follow links to their places: `gone` (n,) are there no more, others have moved, (k, 2) from and to.

        There are `count` links now; what has come is not marked.
        """
        self._reach(max(int(gone.max(initial=-1)), int(moved.max(initial=-1))) + 1)
        self._marked[gone] = False
        self._marked[moved[:, 1]] = self._marked[moved[:, 0]]
        self._marked = self._marked[:count]

    def _reach(self, count: int) -> None:
        if count > len(self._marked):
            grown = np.zeros(max(count, 2 * len(self._marked)), dtype=np.bool_)
            grown[: len(self._marked)] = self._marked
            self._marked = grown
