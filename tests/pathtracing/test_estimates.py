"""The estimates' statistics: seeds, order of work, and whether standard errors mean what they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from solver.pathtracing import PathTracer, estimate
from solver.pathtracing.estimate import ProgressiveEstimate
from solver.pathtracing.sources import PointSource
from solver.pathtracing.tables import build_tables
from solver.pathtracing.tracer import PASSES
from solver.types import FloatArray
from solver.visibility.rays import RayScene
from tests.pathtracing.worlds import cube

LIT = ([0.5] * 6, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
FLOOR_MIDDLE = 0.3952088
"""Irradiance in the middle of the floor of the cube LIT, from the reference."""


def floor_points(n: int) -> tuple[FloatArray, FloatArray]:
    return np.tile([0.5, 0.5, 0.0], (n, 1)), np.tile([0.0, 0.0, 1.0], (n, 1))


def begun(seed: int = 3, samples: int = 64, passes: int | None = 6, n: int = 900) -> ProgressiveEstimate:
    """An estimate over more than one task a pass."""
    surfaces = cube(*LIT).surfaces
    rays = RayScene(surfaces.triangles, surfaces.center, surfaces.size)
    tables, emitters = build_tables(surfaces, rays)
    return ProgressiveEstimate(rays, tables, emitters, PointSource(*floor_points(n)), samples, seed, passes)


def result(of: PathTracer) -> FloatArray:
    return np.stack(of.irradiance(*floor_points(700), 256))


def test_equal_seeds_give_equal_numbers() -> None:
    np.testing.assert_array_equal(result(cube(*LIT, seed=11)), result(cube(*LIT, seed=11)))


def test_other_seeds_give_other_numbers() -> None:
    assert not np.any(result(cube(*LIT, seed=11)) == result(cube(*LIT, seed=12)))


@pytest.mark.parametrize("lanes", [1, 2, 5])
def test_numbers_do_not_depend_on_the_number_of_threads(lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = begun()
    whole.run()
    monkeypatch.setattr(estimate, "core_count", lambda: lanes)
    other = begun()
    other.run()
    np.testing.assert_array_equal(other.mean, whole.mean)
    np.testing.assert_array_equal(other.standard_error, whole.standard_error)
    assert other.ray_count == whole.ray_count


def test_numbers_do_not_depend_on_how_the_work_is_sliced() -> None:
    whole, sliced = begun(), begun()
    whole.run()
    steps = 1
    while sliced.step(0.0):
        steps += 1
    assert steps > 20
    np.testing.assert_array_equal(sliced.mean, whole.mean)
    np.testing.assert_array_equal(sliced.standard_error, whole.standard_error)


def test_passes_of_an_endless_estimate_are_those_of_a_bounded_one() -> None:
    endless, bounded = begun(passes=None), begun(passes=1)
    bounded.run()
    while endless.passes < 1:
        endless.step(0.0)
    assert not endless.finished
    with pytest.raises(ValueError, match="does not end"):
        endless.run()
    first = np.flatnonzero(endless._turns == 1)
    np.testing.assert_array_equal(endless.mean[first], bounded.mean[first])
    assert np.all(np.isinf(bounded.standard_error)), "one pass tells nothing of its scatter"


def test_no_items_are_finished_at_once() -> None:
    nothing = begun(n=0)
    assert nothing.finished
    assert not nothing.step(0.1)
    assert nothing.mean.shape == (0, 3)


def test_samples_must_be_positive() -> None:
    with pytest.raises(ValueError, match="samples_per_pass must be at least 1"):
        begun(samples=0)


def test_standard_errors_are_calibrated() -> None:
    """Errors over standard errors, of many estimates of one known value, are distributed as Student's t."""
    mean, error = cube(*LIT).irradiance(*floor_points(3000), PASSES * 16)
    z = (mean[:, 0] - FLOOR_MIDDLE) / error[:, 0]
    assert stats.kstest(z, stats.t(PASSES - 1).cdf).pvalue > 0.01
    # The two ways to tell the spread agree: between estimates, and what each says of itself.
    spread, told = mean[:, 0].std(ddof=1), np.sqrt((error[:, 0] ** 2).mean())
    assert spread == pytest.approx(told, rel=5.0 / np.sqrt(2 * 3000))


def test_items_are_independent() -> None:
    """The mean over many items of one value has the error that independent items have."""
    mean, error = cube(*LIT).irradiance(*floor_points(3000), PASSES * 16)
    together = np.sqrt((error[:, 0] ** 2).sum()) / 3000
    assert abs(mean[:, 0].mean() - FLOOR_MIDDLE) < 3.5 * together
    neighbours = np.corrcoef(mean[:-1, 0], mean[1:, 0])[0, 1]
    assert abs(neighbours) < 4.0 / np.sqrt(3000)


def test_error_falls_with_samples_at_least_as_chance_would() -> None:
    of = cube(*LIT)
    samples = PASSES * np.array([1, 4, 16, 64])
    told = [np.sqrt((of.irradiance(*floor_points(200), int(n))[1] ** 2).mean()) for n in samples]
    order = np.polyfit(np.log(samples), np.log(told), 1)[0]
    assert order < -0.5
