"""Radical inverses by both ways, and how evenly Halton points lie."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.illumination.particles.radical_inverse import (
    LAST_INDEX,
    count_on,
    first_primes,
    halton_points,
    mirror_digits,
    radical_inverse,
)
from solver.kernels import kernel
from solver.types import FloatArray

PRIMES = (2, 3, 5, 7, 11, 13, 31, 101, 997, 7919)


@kernel
def direct(base: int, start: int, out: FloatArray) -> None:
    for i in range(len(out)):
        out[i] = radical_inverse(base, start + i)


def inverse_exactly(base: int, index: int) -> Fraction:
    value, place = Fraction(0), Fraction(1, base)
    while index:
        index, digit = divmod(index, base)
        value, place = value + digit * place, place / base
    return value


@given(st.sampled_from(PRIMES), st.integers(0, LAST_INDEX - 1))
def test_digits_are_mirrored_at_the_radix_point(base: int, index: int) -> None:
    assert radical_inverse(base, index) == float(inverse_exactly(base, index)) < 1.0


def test_known_values() -> None:
    assert [radical_inverse(2, i) for i in range(8)] == [0, 1 / 2, 1 / 4, 3 / 4, 1 / 8, 5 / 8, 3 / 8, 7 / 8]
    assert [radical_inverse(3, i) for i in range(5)] == [0, 1 / 3, 2 / 3, 1 / 9, 4 / 9]


@pytest.mark.parametrize("dimension", range(10))
def test_counting_on_is_the_direct_way_to_the_last_bit(dimension: int) -> None:
    """Over 200,000 steps, across all carries near 1: no drift."""
    base = int(first_primes(dimension + 1)[dimension])
    out = np.empty(200_000)
    direct(base, 0, out)
    np.testing.assert_array_equal(halton_points(0, len(out), 1, dimension)[:, 0], out)


@given(st.sampled_from(range(len(PRIMES))), st.integers(0, LAST_INDEX - 1), st.integers(0, 50))
def test_counting_on_from_anywhere(which: int, start: int, count: int) -> None:
    base = PRIMES[which]
    stop = min(start + count, LAST_INDEX)
    out = np.empty(stop - start)
    direct(base, start, out)
    dimension = first_primes(1000).tolist().index(base)
    np.testing.assert_array_equal(halton_points(start, stop, 1, dimension)[:, 0], out)


@given(st.sampled_from((2, 3, 7, 101)), st.integers(1, 3))
def test_nines_carry(base: int, digits: int) -> None:
    """What follows b^n - 1, all of whose digits are b - 1, is the smallest fraction yet."""
    mirrored, power = mirror_digits(base, base**digits - 1)
    assert (mirrored, power) == (base**digits - 1, base**digits)
    assert count_on(base, power * base, mirrored * base) == 1


@given(st.sampled_from((2, 3, 5)), st.integers(1, 5), st.integers(0, 20))
def test_each_run_of_a_power_has_one_point_in_every_cell(base: int, power: int, run: int) -> None:
    count = base**power
    points = halton_points(run * count, (run + 1) * count, 1, (2, 3, 5).index(base))[:, 0]
    assert sorted(np.floor(points * count + 1e-9).astype(int).tolist()) == list(range(count))


def test_every_segment_is_more_even_than_chance() -> None:
    """[K 3.1] 1,000 points from anywhere, in boxes at the origin: random ones are off by about 0.03."""
    random = np.random.default_rng(1)
    ends = random.random((200, 2))
    for start in (0, 777, 123_456):
        points = halton_points(start, start + 1000, 2)
        inside = (points[:, None] < ends).all(axis=2).mean(axis=0)
        assert np.abs(inside - ends.prod(axis=1)).max() < 0.008


def test_primes() -> None:
    primes = first_primes(1000)
    assert primes[:10].tolist() == [2, 3, 5, 7, 11, 13, 17, 19, 23, 29]
    assert primes[-1] == 7919
    assert [len(first_primes(count)) for count in (0, 1, 2, 5, 6, 7)] == [0, 1, 2, 5, 6, 7]


@pytest.mark.parametrize(("start", "stop"), [(-1, 3), (3, 2), (0, LAST_INDEX + 1)])
def test_ranges_that_are_none_are_refused(start: int, stop: int) -> None:
    with pytest.raises(ValueError, match="indices of points"):
        halton_points(start, stop, 2)


def test_an_empty_range_has_no_points() -> None:
    assert halton_points(5, 5, 3).shape == (0, 3)
    assert halton_points(0, 5, 0).shape == (5, 0)
