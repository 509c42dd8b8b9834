"""White furnaces: in a closed scene of one material the radiosity is E / (1 - rho) everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from solver.transport.field import SolveOutcome
from solver.types import FloatArray
from tests.transport.solving import furnace, irradiance_at, raw_rows, solved, state_of


@pytest.mark.parametrize(("reflectance", "within"), [(0.5, 1e-3), (0.9, 5e-3), (0.99, 5e-3)])
def test_every_element_is_as_bright(reflectance: float, within: float) -> None:
    solver = solved(furnace(reflectance))
    assert solver.outcome is SolveOutcome.CONVERGED
    assert solver.statistics().closed
    field = solver.field()
    assert len(field.area) > 100, "not by having nothing to resolve"
    np.testing.assert_allclose(field.radiosity, 1.0 / (1.0 - reflectance), rtol=within)


def test_points_in_a_furnace_see_its_light() -> None:
    """Irradiance 2 at every point outside the block, by the exact gather."""
    random = np.random.default_rng(1)
    positions = random.uniform(0.02, 0.98, (200, 3))
    inside = np.all((positions > [0.28, 0.23, 0.33]) & (positions < [0.62, 0.72, 0.67]), axis=1)
    positions = positions[~inside]
    normals = random.normal(size=positions.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    solver = solved(furnace(0.5))
    found = irradiance_at(solver, positions, normals)
    off = found[:, 0] / 2.0 - 1.0
    assert np.sqrt(np.mean(off**2)) < 0.01
    assert np.sqrt(np.mean(off**2)) < solver.error_estimate


def spread(tolerance: float) -> FloatArray:
    """How the rows of the links themselves, before they are balanced, miss 1: mean and RMS over area.

    Over several draws of the rays: a single one misses by chance.
    """
    means, squares = [], []
    for shift in (0.0, 0.1, 0.2, 0.3):
        solver = solved(furnace(0.5, shift=shift), tolerance)
        area = state_of(solver).tree.area[state_of(solver).tree.leaves]
        off = raw_rows(solver) - 1.0
        means.append(area @ off / area.sum())
        squares.append(area @ off**2 / area.sum())
    return np.array([abs(np.mean(means)), np.sqrt(np.mean(squares))])


def test_rows_are_nearly_1_before_they_are_made_so() -> None:
    """Closed scenes are furnaces by construction; the form factors and visibilities are not."""
    coarse, fine = spread(0.08), spread(0.02)
    assert coarse[0] < 3e-3
    assert fine[0] < 5e-4
    assert coarse[1] < 0.03
    assert fine[1] < 0.6 * coarse[1]
