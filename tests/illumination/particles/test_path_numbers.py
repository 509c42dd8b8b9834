"""Numbers of paths: even where they should be, uniform all together, and no one else's business."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from solver.illumination.particles.path_numbers import PathNumbers, PathPoints, hashed
from solver.illumination.particles.radical_inverse import LAST_INDEX, first_primes, halton_points
from solver.types import FloatArray, Int64Array

KINDS = st.sampled_from(list(PathPoints))
SEEDS = st.integers(0, 2**62)
DIMENSIONS = st.integers(0, 30).map(lambda k: 2 * k)


def rows_of(*rows: int) -> Int64Array:
    return np.array(rows, dtype=np.int64)


def pairs(
    points: PathPoints, count: int, dimension: int = 0, seed: int = 0, first: int = 0, spread: float = 0.0
) -> FloatArray:
    return PathNumbers(points, seed).pairs(first, np.arange(count), dimension, spread or 1.0 / count)


@given(KINDS, SEEDS, st.integers(0, 10_000), DIMENSIONS, st.sets(st.integers(0, 200), min_size=1))
def test_numbers_do_not_depend_on_who_is_asked_beside(
    points: PathPoints, seed: int, first: int, dimension: int, rows: set[int]
) -> None:
    numbers = PathNumbers(points, seed)
    whole = numbers.pairs(first, np.arange(201), dimension, 0.01)
    assert np.all((whole >= 0.0) & (whole < 1.0))
    some = np.array(sorted(rows))
    np.testing.assert_array_equal(numbers.pairs(first, some, dimension, 0.01), whole[some])
    shifted = numbers.pairs(first + int(some[0]), some - some[0], dimension, 0.01)
    np.testing.assert_array_equal(shifted, whole[some])


@given(st.sampled_from([0, 1, 2]), st.integers(1, 4), st.integers(0, 20), SEEDS)
def test_scrambled_points_keep_one_in_every_cell(dimension: int, power: int, run: int, seed: int) -> None:
    base = (2, 3, 5)[dimension]
    count = base**power
    even = 2 * (dimension // 2)
    found = pairs(PathPoints.SCRAMBLED, count, even, seed, run * count)[:, dimension - even]
    assert sorted(np.floor(found * count).astype(int).tolist()) == list(range(count))


@given(st.integers(1, 100), DIMENSIONS, SEEDS)
def test_jitter_moves_by_its_range_at_most(count: int, dimension: int, seed: int) -> None:
    """Around the unit interval: none leaves it."""
    moved = pairs(PathPoints.JITTERED, count, dimension, seed)
    moved -= halton_points(0, count, 2, dimension)
    moved = np.where(moved < 0.0, moved + 1.0, moved)
    assert np.all((moved >= 0.0) & (moved < 1.0 / count + 1e-15))


@pytest.mark.parametrize("points", [PathPoints.SCRAMBLED, PathPoints.RANDOM])
@pytest.mark.parametrize("index", [0, 1, 1000])
@pytest.mark.parametrize("dimension", [0, 2, 60])
def test_each_number_is_uniform_over_seeds(points: PathPoints, index: int, dimension: int) -> None:
    found = np.array([pairs(points, 1, dimension, seed, index)[0] for seed in range(3000)])
    counts, _, _ = np.histogram2d(found[:, 0], found[:, 1], bins=6, range=[[0, 1], [0, 1]])
    assert stats.chisquare(counts.ravel()).pvalue > 1e-4


def test_scrambling_takes_points_off_the_diagonal() -> None:
    """16 Halton points of the primes 41 and 43 lie on a line; scrambled, as rooks somewhere."""

    def correlation(points: FloatArray) -> float:
        return float(np.atleast_2d(np.corrcoef(points.T))[0, 1])

    line = halton_points(0, 16, 2, 12)
    assert correlation(line) == pytest.approx(1.0)
    scrambled = [pairs(PathPoints.SCRAMBLED, 16, 12, seed) for seed in range(50)]
    assert np.median([abs(correlation(points)) for points in scrambled]) < 0.4
    # And they go all the way across.
    assert line.max() < 0.4
    assert np.median([np.ptp(points, axis=0).min() for points in scrambled]) > 0.75


def test_seeds_and_dimensions_are_strangers() -> None:
    first = pairs(PathPoints.RANDOM, 4000)
    for other in (pairs(PathPoints.RANDOM, 4000, 2), pairs(PathPoints.RANDOM, 4000, seed=1)):
        both = np.corrcoef(np.concatenate([first, other], axis=1).T)
        assert np.abs(both - np.eye(4)).max() < 0.06


def test_hashed_numbers_are_uniform() -> None:
    found = np.array([hashed(3, index, 5) for index in range(20_000)])
    assert stats.kstest(found, "uniform").pvalue > 1e-3
    assert found.min() >= 0.0 and found.max() < 1.0


def test_many_scrambled_points_are_evener_than_random_ones() -> None:
    """The share in boxes at the origin, over all pairs of the first 5 reflections."""
    ends = np.random.default_rng(1).random((100, 2))

    def error(points: PathPoints, dimension: int) -> float:
        found = pairs(points, 500, dimension)
        return float(np.abs((found[:, None] < ends).all(axis=2).mean(axis=0) - ends.prod(axis=1)).max())

    for dimension in range(0, 10, 2):
        assert error(PathPoints.SCRAMBLED, dimension) < 0.6 * error(PathPoints.RANDOM, dimension)


def test_there_is_an_end() -> None:
    numbers = PathNumbers(PathPoints.SCRAMBLED, 0)
    assert numbers.pairs(LAST_INDEX - 2, rows_of(0, 1), 0, 1.0).shape == (2, 2)
    with pytest.raises(ValueError, match="indices of points"):
        numbers.pairs(LAST_INDEX - 2, rows_of(0, 1, 2), 0, 1.0)
    assert numbers.pairs(LAST_INDEX, rows_of(), 0, 1.0).shape == (0, 2)
    assert first_primes(1)[0] == 2
