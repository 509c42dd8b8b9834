"""Lamps that touch what they light, along edges, at corners and in points ([H 6.4]).

Right means: the irradiance is that of the closed form up to the very line of contact, where it is the limit
from the front of the lamp; what is behind gets nothing; nothing is lost or made.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.geometry.scene import SceneObject
from solver.types import FloatArray
from tests.pathtracing.worlds import material, polygon
from tests.stability.chain import assert_sound, assert_traced, irradiance, solve
from tests.stability.places import SHINING, UP, crate, grid, lamp, quad, room, scene
from tests.transport.solving import box

DISTANCES = np.array([1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])

UPRIGHT = quad("lamp", [0.3, 0.5, 0.0], [0.0, 0.0, 0.5], [0.4, 0.0, 0.0], SHINING)
"""Stands on the floor within it, and shines towards larger y"""

CONTACTS = {
    "edge on the floor": UPRIGHT,
    "edge on the floor, two-sided": SceneObject("lamp", UPRIGHT.mesh, material(0.0, 10.0, True)),
    "edge at the foot of a wall": quad("lamp", [0.0, 0.3, 0.0], [0.0, 0.4, 0.0], [0.3, 0.0, 0.3], SHINING),
    "corner in a corner": quad("lamp", [0.0, 0.0, 0.0], [0.4, 0.0, 0.4], [0.0, 0.4, 0.4], SHINING),
    "a vertex on the floor": polygon(
        "lamp", [(0.5, 0.5, 0.0), (0.7, 0.3, 0.4), (0.7, 0.7, 0.4)], material(0.0, 10.0, True)
    ),
    "a box on the floor": box("lamp", 0.0, 10.0, (0.3, 0.3, 0.0), (0.5, 0.5, 0.5), inward=False),
    "in the ceiling's plane": lamp(1.0),
    "in a wall's plane, from the floor up": quad(
        "lamp", [0.0, 0.3, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.4], SHINING
    ),
}  # fmt: skip


def upright_factor(distance: FloatArray, width: float, height: float) -> FloatArray:
    """From floor points before the middle of an upright rectangle; two times that of its halves."""
    a, b, c = height, 0.5 * width, distance
    far = np.hypot(a, c)
    return np.asarray((np.arctan2(b, c) - c / far * np.arctan2(b, far)) / math.pi)


@pytest.mark.parametrize("name", CONTACTS)
def test_lamps_that_touch(name: str, drawing: Drawing) -> None:
    engine = solve(scene(room(), CONTACTS[name]), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(4), UP)


def test_up_to_the_line_of_contact(drawing: Drawing) -> None:
    """In a black room, where nothing but the lamp counts."""
    engine = solve(scene(room(0.0), UPRIGHT), drawing)
    before = np.stack([np.full(6, 0.5), 0.5 + DISTANCES, np.zeros(6)], axis=1)
    found = irradiance(engine, before, UP)
    np.testing.assert_allclose(found, 10.0 * upright_factor(DISTANCES, 0.4, 0.5), rtol=2e-3)
    np.testing.assert_allclose(found[-1], 5.0, rtol=1e-4)
    behind = before * [1.0, -1.0, 1.0] + [0.0, 1.0, 0.0]
    assert not irradiance(engine, behind, UP).any()
    on_the_line = irradiance(engine, np.array([[0.5, 0.5, 0.0], [0.3, 0.5, 0.0], [0.2, 0.5, 0.0]]), UP)
    assert np.all((on_the_line >= 0.0) & (on_the_line <= 5.0 + 1e-9))


def test_past_the_end_of_the_line(drawing: Drawing) -> None:
    """Around the end of the lamp's lower edge all from 0 to half is met, in however small a circle."""
    engine = solve(scene(room(0.0), UPRIGHT), drawing)
    angle = np.pi * (np.arange(8) + 0.5) / 8
    for radius in (1e-3, 1e-5):
        around = np.stack([0.7 + radius * np.cos(angle), 0.5 + radius * np.sin(angle), np.zeros(8)], axis=1)
        # Seen from so near, the lamp is a quarter of the sphere less the wedge beside it.
        expected = 10.0 * 0.5 * angle / math.pi
        np.testing.assert_allclose(irradiance(engine, around, UP), expected, atol=0.03)


def test_plates_that_touch(drawing: Drawing) -> None:
    """Two black squares at a right angle: of what the one sends, 0.20004 reaches the other."""
    wall = quad("wall", [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], SHINING)
    floor = quad("floor", [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], material(0.0))
    pale = quad("pale", [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], material(1e-3))
    for other in (floor, pale):
        engine = solve(scene(wall, SceneObject("other", other.mesh, other.material)), drawing)
        field = engine._solution.field()
        of_floor = field.patch == 1
        arrived = float(field.area[of_floor] @ field.irradiance[of_floor, 0])
        assert arrived == pytest.approx(10.0 * 0.2000437762, rel=1e-3)


def test_a_crate_that_touches_lamp_and_floor(drawing: Drawing) -> None:
    engine = solve(scene(room(), UPRIGHT, crate("crate", (0.5, 0.5, 0.0), (0.9, 0.8, 0.5))), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(4), UP)
