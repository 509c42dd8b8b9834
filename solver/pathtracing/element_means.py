"""Mean irradiances of elements in the making: passes of paths, more for those that err more.

A pass is `PASS` paths, stratified together; passes are independent, and all weigh the same. An element's
error comes from the spread of its own passes, and of those over the patch that it lies on: few passes
tell their spread badly, and black ones alone would tell of none.

How many passes an element has depends on those before, never on their own values. Still, an element that
looks dark by chance is sampled less than it should be: `explored` sees to it that none is left alone.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.types import FloatArray, Int64Array, IntArray

PASS: Final = 16
"""Paths in a pass: a power of two. Stratified, they do as much as 19 independent ones, and as 30 where light
comes straight from lamps; more of them would leave fewer passes to tell the spread."""

POOLED: Final = 6.0
"""Passes of the patch's mean spread that are added to those of each element. Who seems to err more than it
does gets more passes, and errs less; who seems to err less does not: their own spread alone tells too little
(by 5 % with 2 pooled passes, 1 % with 6, of a room whose elements are all alike)."""

MOST_GROWTH: Final = 2
"""An element gets at most this many times the passes that it has, at once."""

NEGLIGIBLE: Final = 1e-9
"""What is worth less than this part of the most gets nothing."""


class ElementMeans:
    """Running means over the passes of n elements."""

    def __init__(self, count: int) -> None:
        self.passes: Int64Array = np.zeros(count, dtype=np.int64)
        """(n,)"""
        self.irradiance: FloatArray = np.zeros((count, 3))
        """(n, 3) W/m2"""
        self.squares: FloatArray = np.zeros(count)
        """(n,) sum of squared deviations of the passes' reflected luminance"""

    def __len__(self) -> int:
        return len(self.passes)

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return self.passes.nbytes + self.irradiance.nbytes + self.squares.nbytes

    def grow(self, count: int) -> None:
        """Append `count` elements without a pass."""
        self.passes = np.concatenate([self.passes, np.zeros(count, dtype=np.int64)])
        self.irradiance = np.concatenate([self.irradiance, np.zeros((count, 3))])
        self.squares = np.concatenate([self.squares, np.zeros(count)])

    def add(self, ids: IntArray, values: FloatArray, weights: FloatArray) -> None:
        """Take in passes (k, 3), W/m2, of the elements `ids` (k,), ascending; one after another.

        `weights` (n, 3) times irradiance is what each element reflects, luminance.
        """
        if len(ids) == 0:
            return
        # Mean and squares of the new passes of each element, then those of the union (Chan et al. 1979).
        first = np.flatnonzero(np.concatenate([[True], ids[1:] != ids[:-1]]))
        which, more = ids[first], np.diff(np.append(first, len(ids)))
        mean = np.add.reduceat(values, first) / more[:, None]
        off = np.einsum("kc,kc->k", values - np.repeat(mean, more, axis=0), weights[ids])
        squares = np.add.reduceat(off**2, first)
        before, after = self.passes[which], self.passes[which] + more
        change = mean - self.irradiance[which]
        jump = np.einsum("kc,kc->k", change, weights[which])
        self.squares[which] += squares + jump**2 * before * more / after
        self.irradiance[which] += change * (more / after)[:, None]
        self.passes[which] = after

    def spread(self, ids: IntArray, patch: IntArray) -> FloatArray:
        """Variance (m,) of a pass of the elements `ids` (m,), that lie on `patch` (m,): reflected luminance.

        Infinite where no element of the patch has two passes.
        """
        free = np.maximum(self.passes[ids] - 1, 0)
        squares = self.squares[ids]
        all_free, all_squares = np.bincount(patch, free), np.bincount(patch, squares)
        pooled = np.full(len(all_free), np.inf)
        np.divide(all_squares, all_free, out=pooled, where=all_free > 0)
        return np.asarray((squares + POOLED * pooled[patch]) / (free + POOLED))


def deal(passes: int, had: Int64Array, worth: FloatArray) -> Int64Array:
    """How many of about `passes` more each element (n,) gets, that `had` (n,) so far, at least one each.

    Squared errors worth_i^2 / passes_i are least in sum where passes are proportional to `worth` (Neyman
    1934), as far as what elements have and `MOST_GROWTH` allow; fewer are dealt where they do not.
    """
    given = np.zeros(len(had), dtype=np.int64)
    wanting = np.flatnonzero(worth > NEGLIGIBLE * worth.max(initial=0.0))
    if len(wanting) == 0:
        return given
    # Fill up those that have least for their worth, to a common level.
    ratio = had[wanting] / worth[wanting]
    order = wanting[np.argsort(ratio)]
    level = (passes + np.cumsum(had[order])) / np.cumsum(worth[order])
    ratio.sort()
    last = int(np.argmax(np.append(level[:-1] <= ratio[1:], True)))
    filled = order[: last + 1]
    wish = np.minimum(level[last] * worth[filled] - had[filled], MOST_GROWTH * had[filled])
    # Whole numbers that add up to the same.
    ends = np.floor(np.cumsum(np.maximum(wish, 0.0)) + 0.5).astype(np.int64)
    given[filled] = np.diff(ends, prepend=0)
    return given


def explored(round_number: int, each: int, count: int) -> Int64Array:
    """A pass (count,) for every `each`-th of `count` elements, others in each round: none is left alone."""
    return np.asarray((np.arange(count) - round_number) % each == 0).astype(np.int64)
