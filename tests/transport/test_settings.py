"""What every setting does, and what a solve says when one of them stops it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.transport.field import SolveOutcome
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from tests.pathtracing.worlds import material, polygon, world
from tests.transport.solving import DEFAULT, box, finish, lit_cube, shelf, solved, solver_of, state_of

SCENE = shelf()


def solve(settings: SolverSettings) -> RadiositySolver:
    return finish(solver_of(SCENE, settings))


def assert_stopped(solver: RadiositySolver, outcome: SolveOutcome, setting: str) -> None:
    """The solver says what stopped it, what to do about it, and that it is not done."""
    assert solver.outcome is outcome
    assert any(setting in warning for warning in solver.warnings)
    assert solver.error_estimate > solver.settings.error_tolerance
    assert solver.progress < 1.0
    assert not solver.step(1.0), "nothing more to do"
    assert np.all(np.isfinite(solver.field().radiosity))


@pytest.mark.parametrize("tolerance", [0.08, 0.04, 0.02])
def test_error_tolerance_is_met(tolerance: float) -> None:
    solver = solve(SolverSettings(error_tolerance=tolerance))
    assert solver.outcome is SolveOutcome.CONVERGED
    assert solver.error_estimate <= tolerance
    assert solver.progress == 1.0
    assert solver.warnings == ()


def test_a_tighter_tolerance_takes_more() -> None:
    counts = [solve(SolverSettings(error_tolerance=t)).statistics() for t in (0.08, 0.04, 0.02)]
    assert counts[0].leaves < counts[1].leaves < counts[2].leaves
    assert counts[0].links < counts[1].links < counts[2].links


@pytest.mark.parametrize("limit", [3, 100, 1000])
def test_max_elements(limit: int) -> None:
    solver = solve(SolverSettings(max_elements=limit))
    assert_stopped(solver, SolveOutcome.ELEMENT_LIMIT, "max_elements")
    assert solver.statistics().elements <= max(limit, SCENE.surfaces.patch_count)


@pytest.mark.parametrize("limit", [3, 300, 3000])
def test_max_links(limit: int) -> None:
    solver = solve(SolverSettings(max_links=limit))
    assert_stopped(solver, SolveOutcome.LINK_LIMIT, "max_links")
    first = solve(SolverSettings(error_tolerance=1.0)).statistics().links
    assert solver.statistics().links <= max(limit, first)


@pytest.mark.parametrize("least", [0.1, 0.03, 0.015])
def test_minimum_area(least: float) -> None:
    solver = solve(SolverSettings(minimum_area=least))
    assert_stopped(solver, SolveOutcome.MINIMUM_AREA, "minimum_area")
    area = state_of(solver).tree.area
    assert area.min() >= least
    assert area.min() < 8.0 * least, "it is used up"


def test_default_minimum_area_is_far_away() -> None:
    assert solve(DEFAULT).outcome is SolveOutcome.CONVERGED
    assert solve(replace(DEFAULT, minimum_area=1e-12)).outcome is SolveOutcome.CONVERGED


def test_transport_error() -> None:
    """Links below it are left alone: fewer the larger it is."""
    links = []
    for limit in (0.3, 0.1, 0.03):
        solver = solve(SolverSettings(transport_error=limit))
        assert_stopped(solver, SolveOutcome.TRANSPORT_ERROR, "transport_error")
        links.append(solver.statistics().links)
    assert links[0] < links[2]
    assert solve(SolverSettings(transport_error=1e-9)).outcome is SolveOutcome.CONVERGED


def unshot(cutoff: float | None) -> float:
    """RMS of what a gather would still add, over that of the reflected radiosity."""
    state = state_of(solve(SolverSettings(relative_cutoff=cutoff)))
    leaf = state.tree.leaves
    received = state.gather(state.radiosity)[leaf, 0, 0]
    patch = state.tree.patch[leaf]
    reflected = state.radiosity[leaf, 0, 0] - state.emission[patch, 0]
    left = state.reflectance[patch, 0] * received - reflected
    area = state.tree.area[leaf]
    return float(np.sqrt(area @ left**2 / (area @ reflected**2)))


@pytest.mark.parametrize("cutoff", [1e-2, 1e-5, 1e-8])
def test_relative_cutoff(cutoff: float) -> None:
    assert 1e-4 * cutoff < unshot(cutoff) <= cutoff


def test_default_relative_cutoff_is_well_below_the_tolerance() -> None:
    assert unshot(None) <= 0.05 * DEFAULT.error_tolerance


def test_relative_cutoff_above_the_tolerance_is_not_convergence() -> None:
    solver = solve(SolverSettings(relative_cutoff=0.5))
    assert_stopped(solver, SolveOutcome.RELATIVE_CUTOFF, "relative_cutoff")


@pytest.mark.parametrize("side", [0.1, 1e-2, 1e-4])
def test_a_small_bright_lamp_does_not_outshine_what_is_unshot(side: float) -> None:
    """All that it emits arrives, however little of the scene's surface it is."""
    h = 0.5 * side
    corners = [
        [0.5 - h, 0.5 - h, 0.5],
        [0.5 - h, 0.5 + h, 0.5],
        [0.5 + h, 0.5 + h, 0.5],
        [0.5 + h, 0.5 - h, 0.5],
    ]
    lamp = polygon("lamp", corners, material(0.0, 1.0 / side**2, two_sided=True))
    field = solved(world(box("room", 0.8), lamp)).field()
    walls = field.patch < 6
    absorbed = 0.2 * float(field.irradiance[walls, 0] @ field.area[walls])
    lost = float(field.irradiance[~walls, 0] @ field.area[~walls])
    assert absorbed + lost == pytest.approx(2.0, rel=5e-3)


def test_settings_are_said_in_the_statistics() -> None:
    solver = solve(DEFAULT)
    told = solver.statistics()
    assert told.polygons == told.patches == 7
    assert told.channels == 1
    assert told.elements == len(state_of(solver).tree)
    assert told.leaves == len(solver.field().area)
    assert told.links == told.links_full + told.links_partial + told.links_none
    assert told.rays > 0
    assert told.rounds > 1
    assert told.gathers > told.rounds
    assert told.memory_bytes > 0
    assert told.seconds > 0.0
    assert solved(lit_cube((0.5, 0.4, 0.3))).statistics().channels == 3
