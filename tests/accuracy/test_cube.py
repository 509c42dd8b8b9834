"""The unit cube with one face that emits, against the converged solution of its integral equation."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.transport.solve import RadiositySolver
from solver.types import FloatArray
from tests.transport.solving import irradiance_at, lit_cube, solved

REFERENCE = Path(__file__).parents[1] / "data" / "reference"
CASE: dict[str, Any] = json.loads((REFERENCE / "cube.json").read_text())["cases"][
    "A_uniform_rho_ceiling_light"
]
TRUE_B, TRUE_H = np.array(CASE["true_mean_B"]), np.array(CASE["true_mean_H"])
PLACES = {
    "floor": ((0, 1), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "ceiling": ((0, 1), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)),
    "wall_x0": ((1, 2), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
}
"""The two coordinates that the tables give, where the third comes from, and the normal."""


@cache
def solve(tolerance: float) -> RadiositySolver:
    return solved(lit_cube(), tolerance)


def wall_means(solver: RadiositySolver) -> tuple[FloatArray, FloatArray]:
    """Mean radiosity and irradiance of the six faces."""
    field = solver.field()
    area = np.bincount(field.patch, field.area)
    radiosity = np.bincount(field.patch, field.area * field.radiosity[:, 0]) / area
    return radiosity, np.bincount(field.patch, field.area * field.irradiance[:, 0]) / area


def points() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, normals and true irradiances of the tabled points."""
    rows = []
    for wall, values in CASE["point_H"].items():
        axes, origin, normal = PLACES[wall]
        for at, entry in values.items():
            place = np.array(origin)
            place[list(axes)] = [float(x) for x in at.strip("()").split(",")]
            rows.append((place, normal, entry["value"]))
    positions, normals, truth = zip(*rows, strict=True)
    return np.array(positions), np.array(normals), np.array(truth)


def point_errors(solver: RadiositySolver) -> tuple[FloatArray, FloatArray]:
    """Relative errors at the tabled points: made, and told."""
    positions, normals, truth = points()
    found = irradiance_at(solver, positions, normals)
    return found[:, 0] / truth - 1.0, np.full(len(truth), solver.error_estimate)


@pytest.mark.parametrize(("tolerance", "within"), [(0.02, 1e-3), (0.01, 2e-4)])
def test_wall_means(tolerance: float, within: float) -> None:
    radiosity, irradiance = wall_means(solve(tolerance))
    np.testing.assert_allclose(radiosity, TRUE_B, rtol=within)
    np.testing.assert_allclose(irradiance, TRUE_H, rtol=within)


def test_better_than_patches_all_of_one_size() -> None:
    """At the default tolerance the mean radiosities beat 6 x 16 x 16 constant patches."""
    radiosity, _ = wall_means(solve(0.02))
    uniform = np.array(CASE["mean_B_by_N"]["16"])
    assert np.sum((radiosity - TRUE_B) ** 2) < np.sum((uniform - TRUE_B) ** 2)


def test_means_converge() -> None:
    """Their error falls faster than the tolerance, from patch to patch the same."""
    off = [np.abs(wall_means(solve(t))[0] / TRUE_B - 1.0).max() for t in (0.08, 0.02, 0.01)]
    assert off[1] < 0.25 * off[0]
    assert off[2] < off[1]
    sides = wall_means(solve(0.02))[0][2:]
    np.testing.assert_allclose(sides, sides.mean(), rtol=1e-3)


@pytest.mark.parametrize(("tolerance", "within"), [(0.02, 0.01), (0.01, 3e-3)])
def test_points(tolerance: float, within: float) -> None:
    made, told = point_errors(solve(tolerance))
    assert np.abs(made).max() < within
    assert np.sqrt(np.mean(made**2)) < np.sqrt(np.mean(told**2)), "more than it says"


def test_points_converge() -> None:
    rms = [float(np.sqrt(np.mean(point_errors(solve(t))[0] ** 2))) for t in (0.08, 0.02, 0.01)]
    assert rms[2] < rms[1] < 0.5 * rms[0]


@pytest.mark.slow
def test_fine_tolerance() -> None:
    solver = solve(0.005)
    np.testing.assert_allclose(wall_means(solver)[0], TRUE_B, rtol=3e-5)
    assert np.abs(point_errors(solver)[0]).max() < 2e-3
