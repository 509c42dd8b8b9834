"""Polygons of aspect 1 : 10^4 and worse. Right means: as any others, in proportion to their area."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from tests.pathtracing.worlds import material, polygon
from tests.stability.chain import assert_sound, assert_traced, irradiance, power, solve
from tests.stability.places import BOTH, GREY, SHINING, UP, X, Y, grid, lamp, quad, room, scene


def test_slivers_cast_next_to_no_shadow(drawing: Drawing) -> None:
    slivers = [
        quad(f"{k}", [0.1, 0.1 + 0.08 * k, 0.5], [0.8, 3e-3 * k, 0.0], [0.0, 8e-5, 0.0], BOTH)
        for k in range(8)
    ]
    bare, full = solve(scene(room(), lamp()), drawing), solve(scene(room(), lamp(), *slivers), drawing)
    assert_sound(full)
    np.testing.assert_allclose(irradiance(full, grid(5), UP), irradiance(bare, grid(5), UP), rtol=0.03)


@pytest.mark.parametrize("width", [1e-4, 1e-6, 1e-8])
def test_a_wire_that_shines(width: float, drawing: Drawing) -> None:
    """As bright as its power, at any width."""
    wire = quad("lamp", [0.1, 0.5, 0.9], width * Y, 0.8 * X, material(0.0, 1.0 / width))
    engine = solve(scene(room(0.0), wire), drawing)
    assert_sound(engine)
    # A line of 1 W/m: the integral of cos cos' / (pi r^2) along it.
    at = np.array([[0.5, 0.5, 0.0], [0.3, 0.7, 0.0]])
    t = 0.1 + 0.8 * (np.arange(4000) + 0.5) / 4000
    square = (t[None] - at[:, :1]) ** 2 + (0.5 - at[:, 1:2]) ** 2 + 0.9**2
    expected = (0.8 / 4000 * 0.9**2 / (np.pi * square**2)).sum(axis=1)
    np.testing.assert_allclose(irradiance(engine, at, UP), expected, rtol=1e-3)


def test_a_fan_of_needles(drawing: Drawing) -> None:
    """A sheet of 64 triangles with a common corner, 1 : 600 and worse, is the sheet."""
    x = np.linspace(0.0, 1.0, 65)
    edge = np.stack([np.full(65, 0.8), 0.3 + 0.05 * x, np.full(65, 0.5)], axis=1)
    tip = np.array([0.2, 0.3, 0.5])
    needles = [polygon(f"{k}", np.stack([tip, edge[k], edge[k + 1]]), BOTH) for k in range(64)]
    whole = polygon("whole", np.stack([tip, edge[0], edge[-1]]), BOTH)
    fan, sheet = (solve(scene(room(), lamp(), *of), drawing) for of in (needles, [whole]))
    assert_sound(fan)
    assert_traced(fan, grid(4), UP)
    np.testing.assert_allclose(irradiance(fan, grid(5), UP), irradiance(sheet, grid(5), UP), rtol=0.03)
    assert power(fan) == pytest.approx(power(sheet), rel=0.02)


def test_a_floor_of_slats(drawing: Drawing) -> None:
    """A floor cut into strips of 1 : 10^4 and the rest between them is the floor."""
    cuts = np.concatenate(
        [[0.0], np.sort(np.concatenate([np.linspace(0.1, 0.9, 8) + d for d in (0.0, 1e-4)])), [1.0]]
    )
    strips = [quad(f"{k}", [a, 0.0, 0.0], (b - a) * X, Y, GREY) for k, (a, b) in enumerate(pairwise(cuts))]
    above = quad("lamp", [0.3, 0.3, 0.9], 0.4 * Y, 0.4 * X, SHINING)
    whole = quad("floor", [0.0, 0.0, 0.0], X, Y, GREY)
    cut, sheet = (solve(scene(above, *of), drawing) for of in (strips, [whole]))
    assert_sound(cut)
    np.testing.assert_allclose(irradiance(cut, grid(5), UP), irradiance(sheet, grid(5), UP), rtol=1e-6)
