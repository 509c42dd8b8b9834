"""Reflectances of 0.99 and 0.999: light that goes a thousand ways. Right means: what is emitted is absorbed.

In a closed scene whose walls are all of one material, whatever the lamp, that fixes the mean irradiance.
"""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.requests import RendererName
from solver.geometry.scene import SceneObject
from tests.pathtracing.worlds import material
from tests.stability.chain import CLOSED, assert_sound, complete, irradiance, power, solve
from tests.stability.places import UP, crate, grid, lamp, room, scene
from tests.transport.solving import box

REFLECTANCES = (0.99, 0.999)


@pytest.mark.parametrize("reflectance", REFLECTANCES)
@pytest.mark.parametrize("of_lamp", ["white", "grey", "black"])
def test_a_lamp_in_a_white_room(of_lamp: str, reflectance: float, drawing: Drawing) -> None:
    rho = {"white": reflectance, "grey": 0.5, "black": 0.0}[of_lamp]
    shining = box("lamp", rho, 10.0, (0.4, 0.4, 0.7), (0.6, 0.6, 0.8), inward=False)
    engine = solve(scene(room(reflectance), shining), drawing)
    assert_sound(engine, frames=False)
    assert engine.status().statistics.closed
    emitted, absorbed = power(engine)
    assert absorbed == pytest.approx(emitted, rel=CLOSED)
    if of_lamp == "white":
        # The same everywhere but for the first few ways of the light: a mean over all surfaces.
        mean = emitted / (1.0 - reflectance) / float(engine._world.surfaces.area.sum())
        np.testing.assert_allclose(irradiance(engine, grid(4), UP), mean, rtol=0.03)


@pytest.mark.parametrize("reflectance", REFLECTANCES)
def test_a_white_furnace(reflectance: float, drawing: Drawing) -> None:
    shining = room(reflectance, 1.0)
    block = SceneObject("block", crate("", (0.3, 0.3, 0.2), (0.6, 0.7, 0.5)).mesh, material(reflectance, 1.0))
    engine = solve(scene(shining, block), drawing)
    expected = 1.0 / (1.0 - reflectance)
    np.testing.assert_allclose(engine._solution.field().radiosity, expected, rtol=1e-3)
    np.testing.assert_allclose(irradiance(engine, grid(4), UP), expected, rtol=5e-3)
    for renderer in (RendererName.FLAT, RendererName.INTERPOLANT):
        np.testing.assert_allclose(complete(engine, renderer), expected / np.pi, rtol=0.02)


@pytest.mark.parametrize("reflectance", REFLECTANCES)
def test_an_open_white_room(reflectance: float, drawing: Drawing) -> None:
    """A black lid of a tenth of one wall takes nearly all: the series of what it leaves is summed."""
    engine = solve(scene(room(reflectance), lamp()), drawing)
    assert_sound(engine, frames=False)
    emitted, absorbed = power(engine)
    assert absorbed < emitted
    # The lamp's black back and front, 0.16 m2 each, and 1 - rho of 6 m2 share the light by area; the back
    # counts as what escapes.
    walls = 6.0 * (1.0 - reflectance)
    assert absorbed / emitted == pytest.approx((0.16 + walls) / (0.32 + walls), abs=0.15)


@pytest.mark.parametrize("reflectance", [0.99, pytest.param(0.999, marks=pytest.mark.slow)])
def test_a_white_room_seen_by_virtual_lights(reflectance: float, drawing: Drawing) -> None:
    """Paths of thousands of reflections, of which few leave lights."""
    engine = solve(scene(room(reflectance), lamp()), drawing)
    shown, flat = complete(engine, RendererName.VPL), complete(engine, RendererName.FLAT)
    assert np.isfinite(shown).all()
    assert shown.mean() == pytest.approx(flat.mean(), rel=0.2)
