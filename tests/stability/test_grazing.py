"""Blockers that graze what they shade, and points on their edges and vertices.

Right means: before the blocker there is its shadow, behind it nothing has changed, at any slope; a point on
an edge has the light of one of its sides, or what lies between them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.status import SessionState
from tests.pathtracing.worlds import polygon
from tests.stability.chain import SETTINGS, TOLERANCE, assert_sound, assert_traced, irradiance, solve
from tests.stability.places import BOTH, UP, grid, lamp, quad, room, scene

SHEET = quad("sheet", [0.3, 0.3, 0.5], [0.4, 0.0, 0.0], [0.0, 0.4, 0.0], BOTH)


@pytest.mark.parametrize("slope", [0.3, 1e-1, 1e-2])
def test_a_ramp_on_the_floor(slope: float, drawing: Drawing) -> None:
    """A two-sided sheet with one edge on the floor: dark below, open before it."""
    z = 0.6 * slope
    ramp = polygon("ramp", [(0.2, 0.2, 0.0), (0.8, 0.2, 0.0), (0.8, 0.8, z), (0.2, 0.8, z)], BOTH)
    engine = solve(scene(room(), lamp(), ramp), drawing)
    assert_sound(engine)
    at = grid(6)
    beside = at[np.any(np.abs(at[:, :2] - 0.5) > 0.33, axis=1)]
    assert_traced(engine, beside, UP)
    under = irradiance(engine, np.array([[0.5, 0.25, 0.0], [0.5, 0.4, 0.0]]), UP)
    # Besides, leaves on both sides of the hinge are lit on average.
    assert np.all(under < 0.5 * slope + TOLERANCE * irradiance(engine, beside, UP).mean())


@pytest.mark.parametrize("slope", [1e-3, 1e-4, 1e-6])
def test_a_ramp_that_all_but_lies_down(slope: float, drawing: Drawing) -> None:
    z = 0.6 * slope
    ramp = polygon("ramp", [(0.2, 0.2, 0.0), (0.8, 0.2, 0.0), (0.8, 0.8, z), (0.2, 0.8, z)], BOTH)
    engine = solve(scene(room(), lamp(), ramp), drawing)
    assert_sound(engine, frames=slope == 1e-3)
    beside = grid(6)[np.any(np.abs(grid(6)[:, :2] - 0.5) > 0.33, axis=1)]
    assert_traced(engine, beside, UP)


def test_a_ramp_that_rays_cannot_tell_from_the_floor_everywhere(drawing: Drawing) -> None:
    """At a slope of 1e-5 they begin over it near its hinge, under it elsewhere: a limit is met, and told."""
    ramp = polygon("ramp", [(0.2, 0.2, 0.0), (0.8, 0.2, 0.0), (0.8, 0.8, 6e-6), (0.2, 0.8, 6e-6)], BOTH)
    bounded = replace(SETTINGS, max_elements=20_000)
    engine = solve(scene(room(), lamp(), ramp), drawing, bounded)
    status = engine.status()
    assert status.state in (SessionState.CONVERGED, SessionState.PAUSED)
    assert status.state is SessionState.CONVERGED or any("limit" in told for told in status.warnings)
    beside = grid(6)[np.any(np.abs(grid(6)[:, :2] - 0.5) > 0.33, axis=1)]
    assert_traced(engine, beside, UP)


@pytest.fixture(scope="module")
def shaded(drawing: Drawing) -> Engine:
    return solve(scene(room(), lamp(), SHEET), drawing)


def test_points_on_edges_and_vertices_of_a_blocker(shaded: Engine) -> None:
    edge, vertex = np.array([0.5, 0.3, 0.5]), np.array([0.3, 0.3, 0.5])
    away = np.array([0.0, -1e-6, 0.0])
    for normal in (UP, -UP, np.array([0.0, 1.0, 0.0]), np.array([0.6, -0.8, 0.0])):
        for at, aside in ((edge, away), (vertex, np.array([-1e-6, -1e-6, 0.0]))):
            on, outside, inside = irradiance(shaded, np.stack([at, at + aside, at - aside]), normal)
            low, high = min(outside, inside), max(outside, inside)
            assert low * (1.0 - 1e-3) - 1e-9 <= on <= high * (1.0 + 1e-3) + 1e-9


def test_points_under_edges_and_vertices_of_a_blocker(shaded: Engine) -> None:
    """In line with an edge, or a vertex, of lamp and sheet at once: as next to it."""
    at = np.array([[0.3, 0.5, 0.0], [0.5, 0.3, 0.0], [0.3, 0.3, 0.0], [0.7, 0.7, 0.0]])
    at = np.concatenate([at, 0.3 + 1.25 * (at - 0.5) + 0.2])
    on = irradiance(shaded, at * [1.0, 1.0, 0.0], UP)
    beside = irradiance(shaded, at * [1.0, 1.0, 0.0] + [3e-6, -2e-6, 0.0], UP)
    np.testing.assert_allclose(on, beside, rtol=1e-3)


def test_points_above_a_wall_in_line_with_its_face(shaded: Engine) -> None:
    """Points in the sheet's own plane, beside it: it is seen edge-on, and blocks nothing."""
    at = np.array([[0.1, 0.5, 0.5], [0.9, 0.35, 0.5]])
    for normal in (UP, -UP):
        on, over, under = (irradiance(shaded, at + d * UP, normal) for d in (0.0, 1e-5, -1e-5))
        np.testing.assert_allclose(on, 0.5 * (over + under), rtol=2e-2)


def test_grazing_rays_on_the_floor(drawing: Drawing) -> None:
    """A lamp 1e-3 high at the far end of the floor, seen past a sill of the same height."""
    low = quad("lamp", [0.0, 0.9, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1e-3], lamp().material)
    sill = quad("sill", [0.4, 0.5, 0.0], [0.2, 0.0, 0.0], [0.0, 0.0, 1e-3], BOTH)
    engine = solve(scene(room(0.0), low, sill), drawing)
    assert_sound(engine)
    at = np.array([[0.5, 0.4, 0.0], [0.1, 0.4, 0.0], [0.5, 0.7, 0.0]])
    found = irradiance(engine, at, UP)
    assert found[0] < found[1] < found[2]
    assert_traced(engine, at, UP, 0.1)
