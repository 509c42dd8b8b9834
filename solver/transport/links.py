"""Links: who exchanges light with whom at which level of the hierarchy, as one table ([H 4.1]).

A link is symmetric; for any two mutually visible points there is exactly one link between an element
that holds the one and an element that holds the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from solver.arrays import GrowingArray
from solver.kernels import kernel
from solver.types import BoolArray, FloatArray, Int64Array, IntArray

_POOLED: Final = 1 << 21
"""Entries of blocker lists copied between two yields."""


@dataclass(frozen=True, eq=False)
class LinkBatch:
    """Evaluated links about to enter the table, n rows."""

    p: IntArray
    """(n,) element at one end"""
    q: IntArray
    """(n,) element at the other"""
    open_exchange: FloatArray
    """(n,) m2, as if nothing stood between"""
    visibility: FloatArray
    """(n,) visible fraction"""
    samples: IntArray
    """(n,) rays behind `visibility`, in units of 16; 0 where it is exact"""
    noise: FloatArray
    """(n,) expected squared error of `visibility` from sampling"""
    kind: IntArray
    """(n,) FULL, PARTIAL or NONE of `visibility.shafts`"""
    slope_p: FloatArray
    """(n, 2) m2 per metre: how the visible exchange varies with the position on p"""
    slope_q: FloatArray
    """(n, 2) the same on q"""
    residual_p: FloatArray
    """(n,) RMS deviation over p of the form factor from its points to q, from the linear function"""
    residual_q: FloatArray
    """(n,) the same over q"""
    blocker_count: IntArray
    """(n,) length of each blocker list"""
    blockers: IntArray
    """all lists, one after the other: patches"""


_COLUMNS: Final = tuple(column.name for column in fields(LinkBatch) if column.name != "blockers")
"""Names of what the table holds a row of for each link, as in `LinkBatch`."""


class LinkTable:
    """Struct of growing arrays over the links; the columns are those of `LinkBatch`."""

    def __init__(self, capacity: int = 4096) -> None:
        """Without links; `capacity` of them fit before the arrays grow."""
        self._p = GrowingArray((), np.int32, capacity)
        self._q = GrowingArray((), np.int32, capacity)
        self._open_exchange = GrowingArray((), np.float64, capacity)
        self._visibility = GrowingArray((), np.float64, capacity)
        self._samples = GrowingArray((), np.int32, capacity)
        self._noise = GrowingArray((), np.float64, capacity)
        self._kind = GrowingArray((), np.int32, capacity)
        self._slope_p = GrowingArray((2,), np.float64, capacity)
        self._slope_q = GrowingArray((2,), np.float64, capacity)
        self._residual_p = GrowingArray((), np.float64, capacity)
        self._residual_q = GrowingArray((), np.float64, capacity)
        self._blocker_count = GrowingArray((), np.int32, capacity)
        self._blocker_start = GrowingArray((), np.int64, capacity)
        self._pool = GrowingArray((), np.int32, capacity)

    def __len__(self) -> int:
        return len(self._p)

    @property
    def p(self) -> IntArray:
        """(n,) element at one end"""
        return self._p.live

    @property
    def q(self) -> IntArray:
        """(n,) element at the other end"""
        return self._q.live

    @property
    def open_exchange(self) -> FloatArray:
        """(n,) m2 without occlusion"""
        return self._open_exchange.live

    @property
    def visibility(self) -> FloatArray:
        """(n,) visible fraction"""
        return self._visibility.live

    @property
    def samples(self) -> IntArray:
        """(n,) rays behind the visible fraction, in units of 16; 0 where it is exact"""
        return self._samples.live

    @property
    def noise(self) -> FloatArray:
        """(n,) expected squared error of the visible fraction from sampling"""
        return self._noise.live

    @property
    def kind(self) -> IntArray:
        """(n,) visibility class"""
        return self._kind.live

    @property
    def exchange(self) -> FloatArray:
        """(n,) m2, of what is visible"""
        return self.open_exchange * self.visibility

    @property
    def slope_p(self) -> FloatArray:
        """(n, 2) m2 per metre, variation of the visible exchange over p"""
        return self._slope_p.live

    @property
    def slope_q(self) -> FloatArray:
        """(n, 2) m2 per metre, variation of the visible exchange over q"""
        return self._slope_q.live

    @property
    def residual_p(self) -> FloatArray:
        """(n,) RMS deviation over p of the form factor to q from its linear fit"""
        return self._residual_p.live

    @property
    def residual_q(self) -> FloatArray:
        """(n,) RMS deviation over q of the form factor to p from its linear fit"""
        return self._residual_q.live

    @property
    def blocker_start(self) -> Int64Array:
        """(n,) where a link's blockers begin in `pool`"""
        return self._blocker_start.live

    @property
    def blocker_count(self) -> IntArray:
        """(n,) how many there are"""
        return self._blocker_count.live

    @property
    def pool(self) -> IntArray:
        """All blocker lists: patches"""
        return self._pool.live

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        columns: list[GrowingArray[Any]] = [getattr(self, f"_{name}") for name in _COLUMNS]
        return self._pool.nbytes + self._blocker_start.nbytes + sum(column.nbytes for column in columns)

    def append(self, batch: LinkBatch) -> None:
        """Take evaluated links in."""
        start = len(self._pool) + np.cumsum(batch.blocker_count, dtype=np.int64) - batch.blocker_count
        for name in _COLUMNS:
            getattr(self, f"_{name}").append(getattr(batch, name))
        self._blocker_start.append(start)
        self._pool.append(batch.blockers)

    def replace(self, gone: BoolArray, batches: Sequence[LinkBatch]) -> Iterator[None]:
        """Put links in the place of those where `gone` (n,) is true; yields every few milliseconds.

        The table changes in one go, after the last yield.
        """
        kept = np.flatnonzero(~gone)
        rows = len(kept) + sum(len(batch.p) for batch in batches)
        fresh = LinkTable(rows)
        for name in _COLUMNS:
            column: GrowingArray[Any] = getattr(fresh, f"_{name}")
            column.append(getattr(self, name)[kept])
            for batch in batches:
                column.append(getattr(batch, name))
            yield
        count = fresh.blocker_count
        start = np.cumsum(count, dtype=np.int64) - count
        fresh._blocker_start.append(start)
        pool = GrowingArray((), np.int32, int(count.sum()))
        at = 0
        while at < len(kept):
            stop = max(at + 1, int(np.searchsorted(start[: len(kept)], start[at] + _POOLED, side="right")))
            part = kept[at:stop]
            pool.append(take_ranges(self.pool, self.blocker_start[part], self.blocker_count[part]))
            at = stop
            yield
        for batch in batches:
            pool.append(batch.blockers)
            yield
        fresh._pool = pool
        self.__dict__.update(fresh.__dict__)


@kernel
def take_ranges(values: IntArray, start: Int64Array, count: IntArray) -> IntArray:
    """The values of the ranges [start, start + count), one after the other, (sum(count),)."""
    total = 0
    for k in range(len(start)):
        total += count[k]
    out = np.empty(total, dtype=np.int32)
    at = 0
    for k in range(len(start)):
        for i in range(start[k], start[k] + count[k]):
            out[at] = values[i]
            at += 1
    return out
