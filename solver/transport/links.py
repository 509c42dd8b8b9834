"""Links: who exchanges light with whom at which level of the hierarchy, as one table ([H 4.1]).

A link is symmetric; for any two mutually visible points there is exactly one link between an element
that holds the one and an element that holds the other.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Final

import numpy as np

from solver.arrays import GrowingArray
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.transport.pace import finish
from solver.types import BoolArray, FloatArray, Int64Array, IntArray

_POOLED: Final = 1 << 21
"""Entries of blocker lists copied between two yields."""

_TRIM: Final = 1.125
"""Entries of blocker lists that may be kept of those that are needed, when all else is given back"""

_SPARE: Final = 0.25
"""Room for more entries of blocker lists, of those that there are: to move them all takes long. It takes no
memory until it is used."""

_LEAST_POOL: Final = 1 << 16
"""Entries of blocker lists below which tidying is not worth it."""


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

    def chosen(self, rows: Int64Array) -> LinkBatch:
        """The links `rows` (k,) of these."""
        start = np.cumsum(self.blocker_count, dtype=np.int64) - self.blocker_count
        columns = {name: getattr(self, name)[rows] for name in _COLUMNS}
        return LinkBatch(
            **columns, blockers=take_ranges(self.blockers, start[rows], self.blocker_count[rows])
        )

    @staticmethod
    def joined(batches: Sequence[LinkBatch]) -> LinkBatch:
        """One batch of all rows."""
        if len(batches) == 1:
            return batches[0]
        return LinkBatch(
            **{
                column.name: np.concatenate([getattr(batch, column.name) for batch in batches])
                for column in fields(LinkBatch)
            }
        )


_COLUMNS: Final = tuple(column.name for column in fields(LinkBatch) if column.name != "blockers")
"""Names of what the table holds a row of for each link, as in `LinkBatch`."""

_OWN: Final = (*_COLUMNS, "blocker_start", "blocker_room", "debt")
"""All that there is of a link but its blockers."""


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
        self._blocker_room = GrowingArray((), np.int32, capacity)
        self._debt = GrowingArray((), np.int32, capacity)
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
    def blocker_room(self) -> IntArray:
        """(n,) how many there is room for"""
        return self._blocker_room.live

    @property
    def debt(self) -> IntArray:
        """(n,) 0, or the number of the change of geometry that this link does not know of yet"""
        return self._debt.live

    @property
    def pool(self) -> IntArray:
        """All blocker lists: patches"""
        return self._pool.live

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        columns: list[GrowingArray[Any]] = [getattr(self, f"_{name}") for name in _COLUMNS]
        columns += [self._pool, self._blocker_start, self._blocker_room, self._debt]
        return sum(column.nbytes for column in columns)

    def append(self, batch: LinkBatch) -> None:
        """Take evaluated links in."""
        start = len(self._pool) + np.cumsum(batch.blocker_count, dtype=np.int64) - batch.blocker_count
        for name in _COLUMNS:
            getattr(self, f"_{name}").append(getattr(batch, name))
        self._blocker_start.append(start)
        self._blocker_room.append(batch.blocker_count)
        self._debt.grow(len(start))
        self._pool.append(batch.blockers)

    def overwrite(self, rows: IntArray, batch: LinkBatch) -> None:
        """Put the links of `batch` in the place of `rows` (n,), one for one."""
        self.relist(rows, batch.blocker_count, batch.blockers)
        for name in _COLUMNS:
            getattr(self, name)[rows] = getattr(batch, name)
        self.debt[rows] = 0

    def relist(self, rows: IntArray, count: IntArray, blockers: IntArray) -> None:
        """Let the links `rows` (n,) have `count` (n,) of `blockers` each, in lists one after the other."""
        room = self.blocker_room[rows]
        longer = np.where(count > room, count, 0)
        first = self._pool.extend(int(longer.sum()))
        own = first + np.cumsum(longer, dtype=np.int64) - longer
        start = np.where(count > room, own, self.blocker_start[rows])
        put_ranges(blockers, start, count, self.pool)
        self.blocker_start[rows] = start
        self.blocker_count[rows] = count
        self.blocker_room[rows] = np.maximum(room, count)

    def replace(self, gone: IntArray, batches: Sequence[LinkBatch]) -> Iterator[None]:
        """Put links in the place of the rows `gone` (n,), ascending; yields every few milliseconds.

        The table changes in one go, after the last yield but those that tidy up. Rows that stay keep their
        places where as many come as go; else the last ones fill the places that are left.
        """
        fresh = {}
        for name in _COLUMNS:
            fresh[name] = np.concatenate(
                [getattr(self, name)[:0], *(getattr(batch, name) for batch in batches)]
            )
        blockers = np.concatenate([self.pool[:0], *(batch.blockers for batch in batches)])
        yield
        count = fresh["blocker_count"]
        start = len(self._pool) + np.cumsum(count, dtype=np.int64) - count
        filled = min(len(gone), len(count))
        own = {"blocker_start": start, "blocker_room": count, "debt": np.zeros_like(count)}
        for name, column in (fresh | own).items():
            getattr(self, name)[gone[:filled]] = column[:filled]
            getattr(self, f"_{name}").append(column[filled:])
        self._pool.append(blockers)
        self._fill(gone[filled:])
        yield
        yield from self._tidy(2.0)

    def trim(self) -> Iterator[None]:
        """Give back what is held beyond the links themselves, where that is worth it.

        Yields every few milliseconds.
        """
        yield from self._tidy(_TRIM)
        for name in _OWN:
            getattr(self, f"_{name}").trim()
            yield
        self._pool.trim(_SPARE)

    def renumber(self, element: IntArray, patch: IntArray) -> None:
        """Elements and patches get the numbers `element` and `patch` of those that they had; none below 0."""
        known = patch >= 0
        told = [(self.p, element), (self.q, element)]
        if not np.array_equal(patch[known], np.flatnonzero(known)):
            told.append((self.pool, patch))
        for column, number in told:
            run_chunks(partial(_renumber, column, number), len(column), 1 << 18, 1 << 14)

    def forget(self, patch: IntArray, number: int) -> None:
        """Put -1 in the place of blockers that have no new number in `patch` (p,).

        Links that have such a blocker and no debt come into debt to edit `number`.
        """

        def work(start: int, stop: int) -> None:
            _forget(self.pool, self.blocker_start, self.blocker_count, self.debt, patch, number, start, stop)

        run_chunks(work, len(self), 1 << 14)

    def rows_of(self, chosen: BoolArray) -> IntArray:
        """Rows, ascending, of the links of elements (n,) that are `chosen`."""
        marked = np.empty(len(self), dtype=np.bool_)
        p, q = self.p, self.q
        run_chunks(lambda start, stop: _mark_ends(p, q, chosen, start, stop, marked), len(self), 1 << 16)
        return np.flatnonzero(marked).astype(np.int32)

    def remove(self, gone: IntArray) -> None:
        """Take out the rows `gone` (n,), ascending. The last ones fill their places."""
        self._fill(gone)

    def copy(self) -> LinkTable:
        """The same links in arrays of their own."""
        return finish(self.copy_in_steps())

    def copy_in_steps(self) -> Generator[None, None, LinkTable]:
        """As `copy`; yields every few milliseconds. The table must not change meanwhile."""
        other = LinkTable(len(self) + len(self) // 16)
        other._pool = GrowingArray((), np.int32, int((1.0 + _SPARE) * len(self._pool)))
        for name in _OWN:
            getattr(other, f"_{name}").append(getattr(self, name))
            yield
        for start in range(0, len(self._pool), _POOLED):
            other._pool.append(self.pool[start : start + _POOLED])
            yield
        return other

    def _fill(self, holes: IntArray) -> None:
        left = len(self) - len(holes)
        inside = holes[holes < left]
        moved = np.ones(len(self) - left, dtype=np.bool_)
        moved[holes[len(inside) :] - left] = False
        last = left + np.flatnonzero(moved)
        for name in _OWN:
            column = getattr(self, name)
            column[inside] = column[last]
            getattr(self, f"_{name}").truncate(left)

    def _tidy(self, slack: float) -> Iterator[None]:
        """Drop what no link needs from `pool`, where it holds more than `slack` of what they need."""
        count = self.blocker_count
        needed = int(count.sum(dtype=np.int64))
        if len(self._pool) <= max(slack * needed, (slack - 1.0) * _LEAST_POOL):
            return
        start = np.cumsum(count, dtype=np.int64) - count
        pool = GrowingArray((), np.int32, int((0.5 + 0.5 * slack + _SPARE) * needed))
        at = 0
        while at < len(count):
            stop = max(at + 1, int(np.searchsorted(start, start[at] + _POOLED, side="right")))
            pool.append(take_ranges(self.pool, self.blocker_start[at:stop], count[at:stop]))
            at = stop
            yield
        self._pool = pool
        self.blocker_start[:] = start
        self.blocker_room[:] = count


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


@kernel
def put_ranges(values: IntArray, start: Int64Array, count: IntArray, pool: IntArray) -> None:
    """Put `values`, lists one after the other, into the ranges [start, start + count) of `pool`."""
    at = 0
    for k in range(len(start)):
        for i in range(start[k], start[k] + count[k]):
            pool[i] = values[at]
            at += 1


@kernel
def _mark_ends(p: IntArray, q: IntArray, chosen: BoolArray, start: int, stop: int, marked: BoolArray) -> None:
    for link in range(start, stop):
        marked[link] = chosen[p[link]] or chosen[q[link]]


@kernel
def _forget(
    pool: IntArray,
    begin: Int64Array,
    count: IntArray,
    debt: IntArray,
    patch: IntArray,
    number: int,
    start: int,
    stop: int,
) -> None:
    for k in range(start, stop):
        for i in range(begin[k], begin[k] + count[k]):
            if pool[i] >= 0 and patch[pool[i]] < 0:
                pool[i] = -1
                if debt[k] == 0:
                    debt[k] = number


@kernel
def _renumber(column: IntArray, number: IntArray, start: int, stop: int) -> None:
    for i in range(start, stop):
        if column[i] >= 0:
            column[i] = number[column[i]]
