"""Scenes in which little or nothing happens. Right means: that is what they show, and without error."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.geometry.scene import Scene, SceneObject
from tests.pathtracing.worlds import material, polygon
from tests.stability.chain import assert_sound, irradiance, power, solve
from tests.stability.places import BOTH, GREY, SHINING, UP, X, Y, grid, quad, room, scene, seen_from

UPWARD = quad("up", [0.0, 0.0, 1.0], X, Y, SHINING)
DOWNWARD = quad("down", [0.0, 0.0, 0.0], Y, X, SHINING)

SCENES = {
    "nothing": [],
    "one polygon": [UPWARD],
    "one polygon, two-sided": [SceneObject("one", UPWARD.mesh, material(0.5, 3.0, True))],
    "one dark polygon": [SceneObject("one", UPWARD.mesh, GREY)],
    "backs to each other": [UPWARD, DOWNWARD],
    "side by side": [UPWARD, quad("beside", [1.5, 0.0, 1.0], X, Y, SHINING)],
    "all black": [room(0.0), quad("lamp", [0.3, 0.3, 0.9], 0.4 * Y, 0.4 * X, material(0.0))],
    "closed and unlit": [room(0.9)],
    "only degenerate faces": [polygon("line", [[0, 0, 0], [1, 0, 0], [2, 0, 0]], SHINING)],
    "an object without faces": [SceneObject("bare", type(UPWARD.mesh)(np.zeros((0, 3)), ()), GREY)],
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_next_to_nothing(name: str, drawing: Drawing) -> None:
    engine = solve(scene(*SCENES[name]), drawing)
    assert_sound(engine)
    status = engine.status()
    assert status.error_estimate == status.unshot_fraction == 0.0
    field, surfaces = engine._solution.field(), engine._world.surfaces
    np.testing.assert_array_equal(field.radiosity, surfaces.emission[field.patch])
    assert not field.irradiance.any()
    assert power(engine)[1] == 0.0


def test_no_light_anywhere(drawing: Drawing) -> None:
    engine = solve(scene(room(0.5)), drawing)
    assert not irradiance(engine, grid(3, height=0.5), UP).any()


def test_a_lamp_alone_lights_the_points_before_it(drawing: Drawing) -> None:
    engine = solve(scene(UPWARD), drawing)
    at = np.array([[0.5, 0.5, 1.0 + 1e-6], [0.5, 0.5, 1.0 - 1e-6], [0.5, 0.5, 1e6]])
    near, behind, far = irradiance(engine, at, -UP)
    assert near == pytest.approx(10.0, rel=1e-5)
    assert behind == 0.0
    assert far == pytest.approx(10.0 / np.pi * 1e-12, rel=1e-5)


def test_a_camera_within_a_face(drawing: Drawing) -> None:
    bare = scene(room(0.5, 1.0), quad("sheet", [0.2, 0.2, 0.5], 0.6 * X, 0.6 * Y, BOTH))
    eye = np.array([0.5, 0.5, 0.5])
    assert_sound(solve(Scene(bare.objects, {"main": seen_from(eye, eye + X + 0.2 * Y)}), drawing))
