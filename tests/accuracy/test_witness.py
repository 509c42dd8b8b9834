"""Solves of the sample scenes against the path-traced witness: errors are within what was asked and told."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from solver.engine.world import World
from solver.transport.field import SolveOutcome
from solver.transport.solve import RadiositySolver
from tests.accuracy.measure import Measured, measure, sample
from tests.transport.solving import DEFAULT, solved

SAMPLES = ("cornell", "cube_room", "office")
TOLERANCES = (0.08, 0.04, 0.02)


@cache
def scene(name: str) -> World:
    return sample(name)


@cache
def solve(name: str, tolerance: float) -> RadiositySolver:
    return solved(scene(name), tolerance)


@cache
def measured(name: str, tolerance: float, paths: int) -> Measured:
    return measure(scene(name), solve(name, tolerance), paths)


def of_default_run(name: str, tolerance: float) -> Measured:
    """Measured with as many paths as the finer mesh needs."""
    return measured(name, tolerance, 1_200_000 if tolerance < 0.03 else 200_000)


@pytest.mark.parametrize("name", SAMPLES)
def test_default_tolerance(name: str) -> None:
    """At most 2 % of what is reflected, and no more than the solver's own estimate."""
    solver = solve(name, DEFAULT.error_tolerance)
    assert solver.outcome is SolveOutcome.CONVERGED
    found = of_default_run(name, DEFAULT.error_tolerance)
    assert found.error <= 0.02
    assert found.error <= solver.error_estimate <= 0.02


@pytest.mark.parametrize("name", SAMPLES)
def test_estimate_covers_the_error(name: str) -> None:
    for tolerance in TOLERANCES:
        assert of_default_run(name, tolerance).error <= solve(name, tolerance).error_estimate <= tolerance


def test_error_falls_with_the_tolerance() -> None:
    """Halved twice, the tolerance brings the error down with it: a slope in logarithms, over all samples."""
    errors = np.array([[of_default_run(name, t).error for t in TOLERANCES] for name in SAMPLES])
    assert np.all(errors[:, 2] < 0.6 * errors[:, 0])
    slope = np.polyfit(np.log(TOLERANCES), np.log(errors).mean(axis=0), 1)[0]
    assert 0.6 < slope < 1.8


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLES)
def test_error_at_a_finer_tolerance(name: str) -> None:
    found = measured(name, 0.01, 8_000_000)
    assert found.error <= solve(name, 0.01).error_estimate <= 0.01


@pytest.mark.slow
def test_robot_cell() -> None:
    """A thousand small parts: the estimate is short by up to a third, and falls with the error."""
    errors = []
    for tolerance in TOLERANCES:
        found = measured("robot_cell", tolerance, 4_000_000)
        errors.append(found.error)
        assert found.error <= 1.35 * solve("robot_cell", tolerance).error_estimate <= 1.35 * tolerance
    assert errors[2] < errors[1] < errors[0]
