"""Links: who exchanges light with whom at which level of the hierarchy, as one table ([H 4.1]).

A link is symmetric; for any two mutually visible points there is exactly one link between an element
that holds the one and an element that holds the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from solver.arrays import GrowingArray
from solver.kernels import kernel
from solver.types import BoolArray, FloatArray, Int64Array, IntArray


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

    @staticmethod
    def joined(batches: Sequence[LinkBatch]) -> LinkBatch:
        """Batches, at least one, as one."""
        return LinkBatch(
            **{
                column.name: np.concatenate([getattr(batch, column.name) for batch in batches])
                for column in fields(LinkBatch)
            }
        )


class LinkTable:
    """Struct of growing arrays over the links; the columns are those of `LinkBatch`."""

    def __init__(self) -> None:
        self._p = GrowingArray((), np.int32, 4096)
        self._q = GrowingArray((), np.int32, 4096)
        self._open = GrowingArray((), np.float64, 4096)
        self._visibility = GrowingArray((), np.float64, 4096)
        self._samples = GrowingArray((), np.int32, 4096)
        self._noise = GrowingArray((), np.float64, 4096)
        self._kind = GrowingArray((), np.int32, 4096)
        self._slope_p = GrowingArray((2,), np.float64, 4096)
        self._slope_q = GrowingArray((2,), np.float64, 4096)
        self._residual_p = GrowingArray((), np.float64, 4096)
        self._residual_q = GrowingArray((), np.float64, 4096)
        self._blocker_start = GrowingArray((), np.int64, 4096)
        self._blocker_count = GrowingArray((), np.int32, 4096)
        self._pool = GrowingArray((), np.int32, 4096)

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
        return self._open.live

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
        return self._pool.nbytes + sum(column.nbytes for column in self._columns())

    def append(self, batch: LinkBatch) -> None:
        """Take evaluated links in."""
        start = len(self._pool) + np.cumsum(batch.blocker_count, dtype=np.int64) - batch.blocker_count
        self._p.append(batch.p)
        self._q.append(batch.q)
        self._open.append(batch.open_exchange)
        self._visibility.append(batch.visibility)
        self._samples.append(batch.samples)
        self._noise.append(batch.noise)
        self._kind.append(batch.kind)
        self._slope_p.append(batch.slope_p)
        self._slope_q.append(batch.slope_q)
        self._residual_p.append(batch.residual_p)
        self._residual_q.append(batch.residual_q)
        self._blocker_start.append(start)
        self._blocker_count.append(batch.blocker_count)
        self._pool.append(batch.blockers)

    def remove(self, gone: BoolArray) -> None:
        """Drop the links where `gone` (n,) is true; blocker lists are compacted once half are stale."""
        keep = ~gone
        for column in self._columns():
            column.keep(keep)
        used = int(self.blocker_count.sum())
        if len(self._pool) > 2 * used + 4096:
            compact = take_ranges(self.pool, self.blocker_start, self.blocker_count)
            self._pool = GrowingArray((), np.int32, max(4096, used))
            self._pool.append(compact)
            self.blocker_start[...] = np.cumsum(self.blocker_count, dtype=np.int64) - self.blocker_count

    def _columns(self) -> tuple[GrowingArray[np.generic], ...]:
        return (  # type: ignore[return-value]
            self._p,
            self._q,
            self._open,
            self._visibility,
            self._samples,
            self._noise,
            self._kind,
            self._slope_p,
            self._slope_q,
            self._residual_p,
            self._residual_q,
            self._blocker_start,
            self._blocker_count,
        )


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
