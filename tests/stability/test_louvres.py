"""Louvres of 100 slats before a lamp. Right means: as traced paths have it, in bounded time."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from tests.stability.chain import assert_sound, assert_traced, solve
from tests.stability.places import BOTH, SHINING, UP, X, Y, grid, lamp, quad, room, scene


@pytest.mark.parametrize("tilt", [0.0, 0.6, 1.5])
def test_a_hundred_slats(tilt: float, drawing: Drawing) -> None:
    """Lying, tilted, and all but closed."""
    width = 0.0079 * np.array([0.0, np.sin(tilt), np.cos(tilt)])
    slats = [quad(f"{k}", [0.1, 0.1 + 0.008 * k, 0.6], 0.8 * X, width, BOTH) for k in range(100)]
    above = quad("lamp", [0.2, 0.2, 0.95], 0.6 * Y, 0.6 * X, SHINING)
    engine = solve(scene(room(), above, *slats), drawing)
    assert_sound(engine, frames=tilt == 0.6)
    assert_traced(engine, grid(4), UP, 0.1)


@pytest.mark.parametrize("count", [15, pytest.param(50, marks=pytest.mark.slow)])
def test_crossed_louvres(count: int, drawing: Drawing) -> None:
    """A grille of slats, which run through each other."""
    places = 0.2 + 0.6 * np.arange(count) / count
    along = [quad(f"a{y}", [0.2, y, 0.7], 0.6 * X, 0.01 * UP, BOTH) for y in places]
    across = [quad(f"b{x}", [x, 0.2, 0.7], 0.6 * Y, 0.01 * UP, BOTH) for x in places]
    engine = solve(scene(room(), lamp(), *along, *across), drawing)
    assert_sound(engine, frames=False)
    assert_traced(engine, grid(3), UP, 0.1)
