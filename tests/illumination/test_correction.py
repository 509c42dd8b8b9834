"""Defect correction: the light that links miss is put back."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.edit_cases import moved
from solver.document.samples import load_sample
from solver.engine.world import World
from solver.illumination.interpolation.correction import corrected
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.pathtracing import PathTracer
from solver.transport.solve import RadiositySolver
from tests.illumination.fine import drain
from tests.pathtracing.worlds import world
from tests.transport.solving import box, furnace, shelf, solved


def errors(solver: RadiositySolver) -> tuple[float, float]:
    """Relative RMS error of the leaves' reflected light, before and after, less the witness's noise."""
    state = solver.state
    after = drain(corrected(state, PointIrradiance.of(state, solver.hierarchy)))
    field = solver.field()
    truth, noise = PathTracer(solver.surfaces, solver._rays, 5).mean_irradiance(
        field.corners, field.corner_count, field.patch, 4096
    )
    leaves, area = state.tree.leaves, field.area[:, None]

    def error(received: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
        off = (received[leaves, 0] - truth) ** 2 - noise**2
        return float(np.sqrt(max(0.0, (area * off).sum()) / (area * truth**2).sum()))

    return error(state.received), error(after.received)


@pytest.mark.parametrize("tolerance", [0.08, 0.04])
def test_the_error_of_the_solution_falls(tolerance: float) -> None:
    """Over some draws of the rays, which depend on where the scene is."""
    found = []
    for shift in (0.0, 0.1, 0.2):
        scene = load_sample("cornell")
        for name in tuple(scene.objects):
            scene = moved(scene, name, (shift, 0.0, 0.0))
        found.append(errors(solved(World.of(scene), tolerance)))
    before, after = np.sqrt(np.mean(np.square(found), axis=0))
    assert after < 0.75 * before


def test_the_solution_itself_is_left_alone() -> None:
    solver = solved(shelf(), 0.1)
    state = solver.state
    light, received = state.radiosity.copy(), state.received.copy()
    after = drain(corrected(state, PointIrradiance.of(state, solver.hierarchy)))
    np.testing.assert_array_equal(state.radiosity, light)
    np.testing.assert_array_equal(state.received, received)
    assert after.tree is state.tree and after.links is state.links


def test_a_furnace_stays_one() -> None:
    solver = solved(furnace(0.5), 0.05)
    after = drain(corrected(solver.state, PointIrradiance.of(solver.state, solver.hierarchy)))
    leaves = after.tree.leaves
    np.testing.assert_allclose(after.radiosity[leaves, 0], 2.0, rtol=3e-3)


def test_without_reflected_light_nothing_changes() -> None:
    solver = solved(world(box("room", 0.0, 1.0)), 0.05)
    state = solver.state
    assert drain(corrected(state, PointIrradiance.of(state, solver.hierarchy))) is state
