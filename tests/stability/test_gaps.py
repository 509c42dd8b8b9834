"""Gaps from 1e-2 down to 1e-6 of the scene. Right means: the light tends to that of contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from tests.stability.chain import SETTINGS, TOLERANCE, assert_sound, difference, irradiance, power, solve
from tests.stability.places import SHINING, UP, crate, grid, lamp, room, scene

GAPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
LOW, HIGH = np.array([0.3, 0.3, 0.0]), np.array([0.6, 0.6, 0.5])


@pytest.fixture(scope="module")
def touching(drawing: Drawing) -> Engine:
    return solve(scene(room(), lamp(), crate("crate", LOW.tolist(), HIGH.tolist())), drawing)


@pytest.mark.parametrize("gap", GAPS)
def test_a_crate_over_the_floor(gap: float, touching: Engine, drawing: Drawing) -> None:
    over = crate("crate", (LOW + gap * UP).tolist(), (HIGH + gap * UP).tolist())
    engine = solve(scene(room(), lamp(), over), drawing)
    assert_sound(engine, frames=gap in (1e-3, 1e-6))
    away = grid(6)[np.any(np.abs(grid(6)[:, :2] - 0.45) > 0.17, axis=1)]
    off = difference(irradiance(engine, away, UP), irradiance(touching, away, UP))
    assert off < TOLERANCE + 2.0 * gap
    under = irradiance(engine, np.array([[0.45, 0.45, 0.0]]), UP)[0]
    # Leaves of the floor that reach out from under the crate are lit on average, and are seen from there.
    assert under <= TOLERANCE * irradiance(engine, away, UP).mean()


@pytest.mark.parametrize("gap", GAPS)
def test_two_crates_side_by_side(gap: float, drawing: Drawing) -> None:
    """A slit between two crates, with the lamp above."""
    low = crate("left", (0.2, 0.3, 0.0), (0.5, 0.7, 0.4))
    high = crate("right", (0.5 + gap, 0.3, 0.0), (0.8, 0.7, 0.4))
    one = crate("both", (0.2, 0.3, 0.0), (0.8, 0.7, 0.4))
    engine, joined = (solve(scene(room(), lamp(), *of), drawing) for of in ([low, high], [one]))
    assert_sound(engine, frames=gap == 1e-4)
    away = grid(6)[np.abs(grid(6)[:, 0] - 0.5) > 0.31]
    off = difference(irradiance(engine, away, UP), irradiance(joined, away, UP))
    assert off < TOLERANCE + 2.0 * gap


@pytest.mark.parametrize("gap", GAPS)
def test_what_a_lamp_over_the_floor_sends_arrives(gap: float, drawing: Drawing) -> None:
    emitted, absorbed = power(solve(scene(room(0.0), lamp(gap)), drawing))
    assert absorbed == pytest.approx(emitted, rel=TOLERANCE)


@pytest.mark.parametrize("gap", GAPS)
def test_a_lamp_over_the_floor_lights_what_is_under_it(gap: float, drawing: Drawing) -> None:
    """E itself, less what the closed form of two plates lets go at the sides."""
    engine = solve(scene(room(0.0), lamp(gap, SHINING)), drawing)
    assert_sound(engine)
    expected = 10.0 * plate(0.2, gap)
    assert irradiance(engine, np.array([[0.5, 0.5, 0.0]]), UP)[0] == pytest.approx(expected, rel=1e-6)
    outside = irradiance(engine, np.array([[0.5, 0.7 + 30.0 * gap, 0.0]]), UP)[0]
    assert 0.0 < outside < 1e-2, "and next to nothing beside it"


def plate(half: float, distance: float) -> float:
    """The form factor of a parallel square from the point under its middle."""
    x = half / distance
    return float(4.0 / np.pi * x / np.hypot(1.0, x) * np.arctan(x / np.hypot(1.0, x)))


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4])
def test_a_lamp_over_a_pale_floor(gap: float, drawing: Drawing) -> None:
    """What the floor throws back is nearly all caught by the lamp: 0.8 W by each."""
    engine = solve(scene(room(0.5), lamp(gap)), drawing)
    assert_sound(engine, frames=False)


@pytest.mark.parametrize("gap", [1e-2, 1e-4])
def test_a_lamp_over_a_pale_floor_at_a_finer_tolerance(gap: float, drawing: Drawing) -> None:
    """The errors fall with the tolerance all the same."""
    engine = solve(scene(room(0.5), lamp(gap)), drawing, replace(SETTINGS, error_tolerance=0.01))
    emitted, absorbed = power(engine)
    assert absorbed == pytest.approx(emitted, rel=0.1)
