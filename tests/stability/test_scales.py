"""Scenes of 1e-3 m and of 1e4 m, and far from the origin. Right means: the same light."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from tests.stability.chain import TOLERANCE, assert_sound, difference, irradiance, power, solve
from tests.stability.places import UP, crate, grid, lamp, room, scene, transformed

SCENE = scene(room(), lamp(), crate("crate", (0.2, 0.2, 0.0), (0.5, 0.5, 0.5)))
FAR = np.array([1e5, -1e5, 1e5])


@pytest.fixture(scope="module")
def usual(drawing: Drawing) -> Engine:
    engine = solve(SCENE, drawing)
    assert_sound(engine)
    return engine


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e4, 1e7])
def test_any_size(scale: float, usual: Engine, drawing: Drawing) -> None:
    engine = solve(transformed(SCENE, scale=scale), drawing)
    assert_sound(engine, frames=scale in (1e-3, 1e4))
    a, b = engine.status(), usual.status()
    assert a.statistics.leaves == pytest.approx(b.statistics.leaves, rel=0.2)
    np.testing.assert_allclose(power(engine), np.square(scale) * np.array(power(usual)), rtol=0.01)
    found = irradiance(engine, scale * grid(5), UP)
    assert difference(found, irradiance(usual, grid(5), UP)) < 0.5 * TOLERANCE


@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e3])
def test_far_from_the_origin(scale: float, usual: Engine, drawing: Drawing) -> None:
    """Coordinates of 1e5 m have 1.5e-11 m between them: 1e-9 of a scene of 1 cm."""
    engine = solve(transformed(SCENE, shift=FAR, scale=scale), drawing)
    assert_sound(engine, frames=scale == 1.0)
    np.testing.assert_allclose(power(engine), np.square(scale) * np.array(power(usual)), rtol=0.01)
    found = irradiance(engine, scale * grid(5) + FAR, UP)
    assert difference(found, irradiance(usual, grid(5), UP)) < 0.5 * TOLERANCE


def test_a_speck_in_a_large_room(drawing: Drawing) -> None:
    """A crate of 1e-4 of the room, on its floor: lit as the floor about it, and in nobody's way."""
    speck = crate("speck", (0.5, 0.2, 0.0), (0.5001, 0.2001, 0.0001))
    bare, engine = solve(scene(room(), lamp()), drawing), solve(scene(room(), lamp(), speck), drawing)
    assert_sound(engine)
    np.testing.assert_allclose(irradiance(engine, grid(5), UP), irradiance(bare, grid(5), UP), rtol=0.01)
    top = np.array([[0.50005, 0.20005, 0.0001]])
    assert irradiance(engine, top, UP) == pytest.approx(irradiance(bare, top, UP), rel=0.01)
