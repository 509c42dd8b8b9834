"""Means over passes: merged as one would add them up, dealt where they help most."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from solver.pathtracing.element_means import MOST_GROWTH, NEGLIGIBLE, POOLED, ElementMeans, deal, explored
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from tests.pathtracing.worlds import cube


def weights(count: int) -> FloatArray:
    return np.tile(LUMINANCE_WEIGHTS, (count, 1))


@given(st.lists(st.lists(st.integers(0, 4), max_size=12), min_size=1, max_size=5), st.integers(0, 99))
def test_merged_passes_are_as_if_taken_at_once(batches: list[list[int]], seed: int) -> None:
    random = np.random.default_rng(seed)
    means = ElementMeans(5)
    taken = []
    for batch in batches:
        ids = np.sort(np.array(batch, dtype=np.int32))
        values = random.exponential(size=(len(ids), 3))
        taken.append((ids, values))
        means.add(ids, values, weights(5))
    ids, values = (np.concatenate(parts) for parts in zip(*taken, strict=True))
    for k in range(5):
        own = values[ids == k]
        assert means.passes[k] == len(own)
        if len(own):
            luminance = own @ LUMINANCE_WEIGHTS
            np.testing.assert_allclose(means.irradiance[k], own.mean(axis=0), rtol=1e-12)
            np.testing.assert_allclose(means.squares[k], len(own) * luminance.var(), rtol=1e-9, atol=1e-12)


def test_few_passes_take_their_spread_from_the_patch() -> None:
    means = ElementMeans(3)
    ids = np.array([0] * 1000 + [1, 1, 2, 2], dtype=np.int32)
    values = np.ones((len(ids), 3))
    values[:1000] += np.random.default_rng(1).normal(size=(1000, 1))
    means.add(ids, values, weights(3))
    found = means.spread(np.arange(3, dtype=np.int32), np.array([0, 0, 1], dtype=np.int32))
    np.testing.assert_allclose(found[0], 1.0, rtol=0.1)
    np.testing.assert_allclose(found[1], found[0] * POOLED / (1.0 + POOLED), rtol=0.05)
    assert found[2] == 0.0, "another patch"


def test_a_spread_that_nothing_tells_is_infinite() -> None:
    means = ElementMeans(1)
    means.add(np.zeros(1, dtype=np.int32), np.ones((1, 3)), weights(1))
    assert np.isinf(means.spread(np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int32))).all()


had_and_worth = st.lists(st.tuples(st.integers(2, 50), st.floats(0.0, 10.0)), min_size=1, max_size=30)


@given(had_and_worth, st.integers(1, 500))
def test_passes_go_where_there_are_too_few_for_their_worth(
    known: list[tuple[int, float]], passes: int
) -> None:
    had = np.array([h for h, _ in known], dtype=np.int64)
    worth = np.array([w for _, w in known])
    given_passes = deal(passes, had, worth)
    assert given_passes.min() >= 0
    assert given_passes.sum() <= passes + 1
    assert np.all(given_passes <= MOST_GROWTH * had + 1)
    assert np.all(given_passes[worth == 0.0] == 0)
    # Nobody who was given some is better off, beyond rounding, than anyone who could have had more.
    counts = worth > NEGLIGIBLE * worth.max()
    level = (had + given_passes) / np.where(counts, worth, 1.0)
    slack = 1.0 / np.where(counts, worth, 1.0)
    could = counts & (given_passes < MOST_GROWTH * had - 1)
    got = given_passes > 1
    if could.any() and got.any():
        assert (level - 2.0 * slack)[got].max() <= (level + 2.0 * slack)[could].min() + 1e-9


def test_every_element_is_explored_in_its_turn() -> None:
    each = 7
    total = sum(explored(k, each, 40) for k in range(3, 3 + each))
    np.testing.assert_array_equal(total, np.ones(40))


def test_a_pass_repeats_by_its_number_and_agrees_with_the_mean() -> None:
    """Of an element taken many times in a pass, each time on its own."""
    tracer = cube([0.5] * 6, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    patch = np.zeros(256, dtype=np.int32)
    corners, count = tracer.surfaces.corners[patch], tracer.surfaces.corner_count[patch]
    found = []
    for number in (1, 1, 2):
        estimate = tracer.element_pass(corners, count, patch, 16, number)
        estimate.run()
        found.append(estimate.mean[:, 0])
    np.testing.assert_array_equal(found[0], found[1])
    assert not np.any(found[0] == found[2])
    mean, error = tracer.mean_irradiance(corners[:1], count[:1], patch[:1], 8192)
    for values in found:
        own = values.std() / np.sqrt(len(values))
        assert abs(values.mean() - mean[0, 0]) < 4.0 * np.hypot(own, error[0, 0])
