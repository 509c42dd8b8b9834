"""The sequences are scrambled (0, 2)-sequences, and the maps from the square keep their measures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from solver.kernels import kernel
from solver.pathtracing.sampling import (
    cosine_direction,
    mix,
    pair,
    reverse_bits,
    single,
    stream_of,
    triangle_weights,
)
from solver.types import FloatArray

WORDS = st.integers(0, 2**32 - 1)


@kernel
def points(stream: np.uint64, count: int, number: int, out: FloatArray) -> None:
    for index in range(count):
        out[index, 0], out[index, 1] = pair(stream, np.uint64(index), number)


@kernel
def singles(stream: np.uint64, count: int, number: int, out: FloatArray) -> None:
    for index in range(count):
        out[index] = single(stream, np.uint64(index), number)


def sequence(stream: int, count: int, number: int) -> FloatArray:
    out = np.empty((count, 2))
    points(np.uint64(stream), count, number, out)
    return out


@given(WORDS)
def test_reversing_bits_twice_changes_nothing(word: int) -> None:
    reversed_word = int(reverse_bits(np.uint64(word)))
    assert f"{reversed_word:032b}" == f"{word:032b}"[::-1]


@given(st.lists(WORDS, min_size=2, unique=True))
def test_mixing_is_one_to_one(words: list[int]) -> None:
    mixed = {int(mix(np.uint64(word))) for word in words}
    assert len(mixed) == len(words)
    assert max(mixed) < 2**32


@given(WORDS, st.integers(0, 40), st.integers(0, 8))
def test_points_are_stratified_in_every_elementary_interval(stream: int, number: int, power: int) -> None:
    """Of 2^m points, each of the 2^m boxes of area 2^-m has one, whatever the boxes' shape."""
    u = sequence(stream, 2**power, number)
    assert np.all((u > 0.0) & (u < 1.0))
    for across in range(power + 1):
        box = np.floor(u * [2**across, 2 ** (power - across)]).astype(int)
        assert len(np.unique(box, axis=0)) == 2**power


@pytest.mark.parametrize("number", [0, 1, 2, 7])
def test_points_are_uniform_over_streams(number: int) -> None:
    """The same sample of many streams is spread as chance would have it: each is unbiased by itself."""
    u = np.array([sequence(int(stream_of(np.uint64(99), item)), 3, number)[2] for item in range(4000)])
    counts, _, _ = np.histogram2d(u[:, 0], u[:, 1], bins=8, range=[[0, 1], [0, 1]])
    assert stats.chisquare(counts.ravel()).pvalue > 1e-3


def test_pairs_of_one_stream_are_independent() -> None:
    """Samples are shuffled anew in every pair."""
    first, second = (sequence(12345, 4096, number) for number in (1, 2))
    joint, _, _ = np.histogram2d(first[:, 0], second[:, 0], bins=8, range=[[0, 1], [0, 1]])
    assert stats.chisquare(joint.ravel()).pvalue > 1e-3


def test_singles_are_uniform() -> None:
    u = np.empty(20000)
    singles(np.uint64(7), len(u), 3, u)
    assert stats.kstest(u, "uniform").pvalue > 1e-3


@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda n: np.linalg.norm(n) > 1e-3),
    st.floats(0, 0.999),
    st.floats(0, 0.999),
)
def test_directions_are_unit_and_above(normal: list[float], u: float, v: float) -> None:
    nx, ny, nz = (part / float(np.linalg.norm(normal)) for part in normal)
    *direction, cosine = cosine_direction(nx, ny, nz, u, v)
    assert np.linalg.norm(direction) == pytest.approx(1.0, abs=1e-12)
    assert np.dot(direction, (nx, ny, nz)) == pytest.approx(cosine, abs=1e-12)
    assert cosine >= 0.0


def test_directions_are_cosine_distributed() -> None:
    u = sequence(1, 4096, 0)
    x, y, z = 0.6, -0.64, -0.48
    normal = np.array([x, y, z])
    directions = np.array([cosine_direction(x, y, z, a, b)[:3] for a, b in u])
    # The squared sine is uniform, and the vector mean is 2/3 of the normal.
    assert stats.kstest(1.0 - (directions @ normal) ** 2, "uniform").statistic < 0.01
    np.testing.assert_allclose(directions.mean(axis=0), 2.0 / 3.0 * normal, atol=2e-3)


def test_triangle_points_are_uniform_by_area() -> None:
    weights = np.array([triangle_weights(u, v) for u, v in sequence(2, 4096, 0)])
    assert weights.min() >= 0.0 and weights.sum(axis=1).max() <= 1.0
    # The four similar quarters of a triangle hold a quarter of the points each.
    first = 1.0 - weights.sum(axis=1)
    for corner in (first, *weights.T):
        assert (corner > 0.5).mean() == pytest.approx(0.25, abs=0.005)
