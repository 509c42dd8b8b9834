"""Radiances that span ten decades. Right means: the weak ones are there, in their own proportion."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.geometry.scene import SceneObject
from tests.pathtracing.worlds import material
from tests.stability.chain import assert_sound, assert_traced, irradiance, power, solve
from tests.stability.places import UP, X, Y, grid, lamp, quad, room, scene

DECADES = [10.0**k for k in range(-5, 6)]


def test_lamps_of_ten_decades(drawing: Drawing) -> None:
    lamps = [
        quad(f"{k}", [0.05 + 0.08 * k, 0.3, 0.9], 0.08 * Y, 0.07 * X, material(0.5, e))
        for k, e in enumerate(DECADES)
    ]
    engine = solve(scene(room(), *lamps), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(4), UP)


@pytest.mark.parametrize("emission", [1e-12, 1e-5, 1e5, 1e12])
def test_light_is_linear_over_all_decades(emission: float, drawing: Drawing) -> None:
    one, other = (solve(scene(room(), lamp(of=material(0.0, e))), drawing) for e in (1.0, emission))
    assert_sound(other, frames=emission in (1e-12, 1e12))
    found, expected = irradiance(other, grid(4), UP) / emission, irradiance(one, grid(4), UP)
    np.testing.assert_allclose(found, expected, rtol=0.03)


def test_a_faint_lamp_in_a_chamber_of_its_own(drawing: Drawing) -> None:
    """A chamber lit by 1e-5 W/m2 beside one lit by 1e5: not a trace of the bright light comes in."""
    faint = SceneObject("faint", lamp().mesh, material(0.0, 1e-5))
    alone = solve(scene(room(0.0), faint), drawing)
    beside = quad("bright", [1.3, 0.3, 0.9], 0.4 * Y, 0.4 * X, material(0.0, 1e5))
    other = SceneObject(
        "other", type(room().mesh)(room().mesh.vertices + X, room().mesh.faces), material(0.5)
    )
    both = solve(scene(room(0.0), faint, other, beside), drawing)
    assert_sound(both)
    np.testing.assert_allclose(irradiance(both, grid(4), UP), irradiance(alone, grid(4), UP), rtol=1e-6)


def test_reflectances_from_next_to_nothing(drawing: Drawing) -> None:
    walls = room(1e-9)
    engine = solve(scene(walls, lamp()), drawing)
    assert_sound(engine)
    emitted, absorbed = power(engine)
    assert absorbed == pytest.approx(emitted, rel=0.01)
