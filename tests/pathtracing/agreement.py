"""Statistical agreement: estimates against the truth, many at once, with a known chance of a false alarm."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy import stats

from solver.pathtracing.tracer import PASSES
from solver.types import BoolArray, FloatArray

FALSE_ALARM: Final = 1e-3
"""Chance that any one of the comparisons of a call fails although all estimates are right."""


def disagreements(
    mean: FloatArray,
    standard_error: FloatArray,
    truth: FloatArray | float,
    truth_error: FloatArray | float = 0.0,
    passes: int = PASSES,
) -> BoolArray:
    """Which estimates differ from the truth by more than chance allows: Student's t, after Sidak.

    An estimate without scatter must be exact, but for rounding.
    """
    error = np.hypot(standard_error, truth_error)
    scatters = error > 1e-9 * np.abs(truth)
    ratio = np.abs(mean - truth) / np.where(scatters, error, 1.0)
    chance = 2.0 * stats.t.sf(ratio, passes - 1)
    level = 1.0 - (1.0 - FALSE_ALARM) ** (1.0 / mean.size)
    exact = np.isclose(mean, truth, rtol=1e-6, atol=1e-12)
    return np.asarray(np.where(scatters, chance < level, ~exact))


def assert_agrees(
    mean: FloatArray,
    standard_error: FloatArray,
    truth: FloatArray | float,
    truth_error: FloatArray | float = 0.0,
    passes: int = PASSES,
) -> None:
    """Fail where estimates and truth disagree, with the worst of them."""
    wrong = disagreements(mean, standard_error, truth, truth_error, passes)
    if wrong.any():
        at = np.unravel_index(np.argmax(wrong * np.abs(mean - truth)), mean.shape)
        expected = np.broadcast_to(truth, mean.shape)[at]
        raise AssertionError(
            f"{wrong.sum()} of {wrong.size} disagree; the worst, {at}: {mean[at]:.7g} +- "
            f"{standard_error[at]:.2g}, not {expected:.7g}"
        )
