"""Icospheres of 1,280 and of 20,480 triangles. Right means: as a ball, in bounded time and memory."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import RendererName
from solver.engine.status import SessionState
from tests.pathtracing.worlds import material
from tests.stability.chain import (
    LONGEST,
    MOST_BYTES,
    SETTINGS,
    TOLERANCE,
    assert_sound,
    assert_traced,
    assert_within,
    brightest,
    complete,
    power,
    settle,
    solve,
)  # fmt: skip
from tests.stability.places import GREY, UP, ball, grid, lamp, room, scene


def test_a_ball_of_1280_triangles(drawing: Drawing) -> None:
    engine = solve(scene(room(), lamp(), ball("ball", 3, GREY, radius=0.25)), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(4), UP)
    status = engine.status().statistics
    assert status.polygons == 1287
    assert status.links < 50_000, "triangles see the walls and not each other"
    assert status.seconds < 0.5 * LONGEST


@pytest.mark.slow
def test_a_ball_of_1280_triangles_from_inside(drawing: Drawing) -> None:
    """All 818,560 pairs see each other, the worst that linking from all pairs can meet."""
    engine = Engine(scene(ball("ball", 3, material(0.5, 1.0), inward=True)), SETTINGS, drawing=drawing)
    settle(engine)
    assert_sound(engine, frames=False)
    np.testing.assert_allclose(engine._solution.field().radiosity, 2.0, rtol=5e-3)


@pytest.mark.slow
def test_a_ball_of_20480_triangles(drawing: Drawing) -> None:
    """Too many to be linked: the light is sampled, and it is told."""
    engine = solve(scene(room(), lamp(), ball("ball", 5, GREY, radius=0.25)), drawing, longest=10.0 * LONGEST)
    status = engine.status()
    assert status.state is SessionState.CONVERGED and status.error_estimate <= TOLERANCE
    assert status.statistics.memory_bytes < MOST_BYTES
    assert any("sampled" in told for told in status.warnings)
    field = engine._solution.field()
    assert_within(field.irradiance, brightest(engine))
    emitted, absorbed = power(engine)
    assert 0.9 * emitted < absorbed < 1.02 * emitted
    for renderer in (RendererName.FLAT, RendererName.INTERPOLANT, RendererName.VPL):
        assert np.isfinite(complete(engine, renderer)).all()
    assert_traced(engine, grid(4), UP)


def test_more_than_can_be_linked(drawing: Drawing) -> None:
    """5,120 triangles, without waiting for the end: there are frames from the start, and they get better."""
    engine = Engine(scene(room(), lamp(), ball("ball", 4, GREY, radius=0.25)), SETTINGS, drawing=drawing)
    for _ in range(10):
        engine.step(0.05)
    status = engine.status()
    assert status.state in (SessionState.SOLVING, SessionState.CONVERGED)
    assert status.statistics.memory_bytes < MOST_BYTES
    assert_within(engine._solution.field().irradiance, brightest(engine))
    found = engine.probe(grid(2), np.broadcast_to(UP, (4, 3))).irradiance
    assert found.min() > 0.0
