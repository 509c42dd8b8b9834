"""Each pattern puts its points where it says, and [K fig. 8] is as the paper has it."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from benchmarks.patterns import MOST, measure_pattern
from solver.illumination.particles.patterns import Pattern, pattern_points
from solver.types import FloatArray

COUNTS = st.integers(1, 70)
UNIFORM = [Pattern.RANDOM, Pattern.JITTERED, Pattern.N_ROOKS]


def points(pattern: Pattern, count: int, sets: int = 3, seed: int = 1) -> FloatArray:
    return pattern_points(pattern, count, sets, np.random.default_rng(seed))


@given(st.sampled_from(list(Pattern)), COUNTS)
def test_any_number_of_points_in_the_square(pattern: Pattern, count: int) -> None:
    found = points(pattern, count)
    assert found.shape == (3, count, 2)
    assert np.all((found >= 0.0) & (found < 1.0))
    np.testing.assert_array_equal(found, points(pattern, count))


@given(st.sampled_from([Pattern.N_ROOKS, Pattern.JITTERED_HAMMERSLEY]), COUNTS)
def test_rooks_have_a_row_and_a_column_each(pattern: Pattern, count: int) -> None:
    cells = np.floor(points(pattern, count) * count).astype(int)
    np.testing.assert_array_equal(np.sort(cells, axis=1), np.tile(np.arange(count)[:, None], (3, 1, 2)))


@given(st.integers(0, 6))
def test_jittered_hammersley_points_are_hammersley_points_moved(power: int) -> None:
    count = 2**power
    moved = points(Pattern.JITTERED_HAMMERSLEY, count) - points(Pattern.HAMMERSLEY, count)
    assert np.all((moved >= 0.0) & (moved < 1.0 / count))


def test_hammersley_points() -> None:
    expected = [[0.0, 0.0], [0.25, 0.5], [0.5, 0.25], [0.75, 0.75]]
    assert points(Pattern.HAMMERSLEY, 4, 1)[0].tolist() == expected


@given(COUNTS)
def test_cells_are_of_equal_area_and_have_a_point_each(count: int) -> None:
    """Row by row, each from left to right; of several, none is more than twice as long as high."""
    found = points(Pattern.JITTERED, count)
    rows = round(math.sqrt(count))
    first = np.arange(rows + 1) * count // rows
    for begin, end in pairwise(first.tolist()):
        length = end - begin
        x, y = found[:, begin:end, 0], found[:, begin:end, 1]
        assert np.all(np.floor(x * length).astype(int) == np.arange(length))
        assert np.all((y >= begin / count) & (y < end / count))
        if count > 3:
            assert 0.5 <= count / length**2 <= 2.0


@pytest.mark.parametrize("pattern", UNIFORM, ids=lambda pattern: pattern.value)
@pytest.mark.parametrize("count", [1, 5, 8])
def test_points_of_all_sets_are_uniform(pattern: Pattern, count: int) -> None:
    found = points(pattern, count, 20_000 // count).reshape(-1, 2)
    counts, _, _ = np.histogram2d(found[:, 0], found[:, 1], bins=10, range=[[0, 1], [0, 1]])
    # Stratified, cells are hit more evenly than chance has it: only too uneven ones are wrong.
    assert stats.chisquare(counts.ravel()).pvalue > 1e-3


def test_pixels_converge_as_in_figure_8() -> None:
    """Jittered Hammersley points do best, at any number of samples."""
    figures = {pattern: measure_pattern(pattern.value, 24, 1) for pattern in Pattern}
    slopes = {pattern: found.slope for pattern, found in figures.items()}
    assert slopes[Pattern.RANDOM] == pytest.approx(-0.5, abs=0.04)
    assert slopes[Pattern.JITTERED] == pytest.approx(-0.75, abs=0.04)
    assert slopes[Pattern.N_ROOKS] == pytest.approx(-0.58, abs=0.04)
    assert slopes[Pattern.JITTERED_HAMMERSLEY] == pytest.approx(-0.79, abs=0.04)
    # Without jitter, few samples alias: as steep, but from higher up.
    assert slopes[Pattern.HAMMERSLEY] == pytest.approx(-0.81, abs=0.05)

    errors = {pattern: np.array(found.errors) for pattern, found in figures.items()}
    best = errors.pop(Pattern.JITTERED_HAMMERSLEY)
    several = np.arange(1, MOST + 1) >= 4
    for pattern, other in errors.items():
        assert np.mean(best[several] < other[several]) > 0.95, pattern
    shares = {pattern: float(np.exp(np.mean(np.log(best / other)))) for pattern, other in errors.items()}
    assert shares[Pattern.JITTERED] < 0.9
    assert shares[Pattern.N_ROOKS] < 0.75
    assert shares[Pattern.HAMMERSLEY] < 0.8
    assert shares[Pattern.RANDOM] < 0.45
