"""The estimated error of a sampled field, by the spread of its passes and by what its elements smooth away.

With y an element's reflected luminance, the error is that of `solver.transport.estimate`: the squared
errors of y, over elements by area, relative to the squares of y. Where a scene holds bright fittings, such
as lamps in reflectors, these are nearly all of that norm, and rooms may be as noisy as can be. Hence the
same is asked a second time with each element weighed by 1 / (y + typical)^2, which tells the relative
error of what is bright, and the error relative to what is typical of what is dark. The larger one counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.transport.estimate import LEAF
from solver.types import BoolArray, FloatArray, IntArray

SAFETY: Final = 1.05
"""Factor on the noise: passes that are dealt by their own spread tell 1 to 3 % too little of it."""

SIGNIFICANT: Final = 4.0
"""Siblings differ if their variance is more than this times what noise makes of equal ones."""

WITHIN: Final = 1.0 / 3.0
"""Variance within the parts of an element, where light is linear, relative to that between them."""


@dataclass(frozen=True, eq=False)
class SampledError:
    """Where the error of m leaves is; squares of relative errors, by both norms."""

    weight: FloatArray
    """(m,) by which squared errors of reflected luminance count, both norms together"""
    noise: FloatArray
    """(2,) squared error by noise"""
    variation: FloatArray
    """(2,) squared error by light that varies within elements"""
    excess: FloatArray
    """(m,) the same, leaf by leaf, both norms together, where it is significant; 0 elsewhere"""

    @property
    def relative(self) -> float:
        """Relative error of the reflected radiosity, 0 to 1."""
        return min(1.0, float(np.sqrt((self.noise + self.variation).max())))


def sampled_error(
    reflected: FloatArray, variance: FloatArray, area: FloatArray, parent: IntArray, reflects: BoolArray
) -> SampledError:
    """The error of leaves (m,) with means `reflected`, whose error squared is `variance`, finite.

    `parent` (m,) is -1 for whole patches; `reflects` (m,) tells what can be lit at all.
    """
    within, is_known, is_significant = _variation(reflected, variance, area, parent)
    typical = _median(reflected, np.where(reflects & (reflected > 0.0), area, 0.0))
    weight = np.zeros(len(area))
    noise, spread = np.zeros((2, 2))
    excess = np.zeros(len(area))
    for k, bounded in enumerate((False, True)):
        each = area / (reflected + typical) ** 2 if bounded and typical > 0.0 else area
        squares = each * reflected**2
        # Noise adds its variance to the squares of what it disturbs.
        norm = float(squares.sum()) - float((each * variance).sum())
        if norm <= 0.0:
            if squares.any():
                noise[k] = 1.0
                weight += each / float(squares.sum())
            continue
        share = each / norm
        weight += share
        noise[k] = SAFETY**2 * float((share * variance).sum())
        # Patches that are one element tell nothing: they are taken to vary as others do.
        told = LEAF * share * within
        seen = float(squares[is_known].sum())
        ratio = max(0.0, float(told[is_known].sum())) * norm / seen if seen > 0.0 else 0.0
        guessed = np.where(is_known, 0.0, ratio * squares / norm)
        spread[k] = max(0.0, float(told.sum())) + float(guessed.sum())
        excess += np.where(is_significant, np.maximum(told, 0.0), 0.0) + guessed
    return SampledError(weight, noise, spread, excess)


def _variation(
    reflected: FloatArray, variance: FloatArray, area: FloatArray, parent: IntArray
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Variance within leaves, as their siblings tell it, whether they do, and whether it is above noise.

    Free of noise on average: it may be negative.
    """
    own = np.arange(len(parent))
    family = np.unique(np.where(parent >= 0, parent.astype(np.int64), -1 - own), return_inverse=True)[1]
    whole = np.bincount(family, area)[family]
    share = area / whole
    mean = np.bincount(family, share * reflected)[family]
    between = np.bincount(family, share * (reflected - mean) ** 2)[family]
    by_noise = np.bincount(family, share * (1.0 - share) * variance)[family]
    is_known = np.bincount(family)[family] > 1
    within = np.where(is_known, WITHIN * (between - by_noise), 0.0)
    return within, is_known, is_known & (between > SIGNIFICANT * by_noise)


def _median(values: FloatArray, weights: FloatArray) -> float:
    """Weighted median; 0 where nothing has weight."""
    order = np.argsort(values)
    ends = np.cumsum(weights[order])
    if len(ends) == 0 or ends[-1] <= 0.0:
        return 0.0
    return float(values[order[np.searchsorted(ends, 0.5 * ends[-1])]])
