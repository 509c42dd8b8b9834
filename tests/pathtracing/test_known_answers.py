"""Irradiance with a known answer: furnaces, closed forms of direct light, the reference cube."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.geometry.scene import Mesh, SceneObject
from solver.pathtracing import PathTracer
from solver.types import FloatArray
from tests.pathtracing.agreement import assert_agrees
from tests.pathtracing.worlds import CUBE, INWARD, OUTWARD, cube, material, polygon, square, tracer

REFERENCE = Path(__file__).parent.parent / "data" / "reference"
CASE: dict[str, Any] = json.loads((REFERENCE / "cube.json").read_text())["cases"][
    "A_uniform_rho_ceiling_light"
]
OPPOSITE, ADJACENT = 0.199824895698387, 0.200043776075403
"""Form factors between faces of a cube."""

UP = np.array([0.0, 0.0, 1.0])


def patch_irradiance(of: PathTracer, samples: int) -> tuple[FloatArray, FloatArray]:
    s = of.surfaces
    return of.mean_irradiance(s.corners, s.corner_count, np.arange(s.patch_count, dtype=np.int32), samples)


def at_point(
    of: PathTracer, x: float, y: float, z: float, samples: int = 1 << 14
) -> tuple[FloatArray, FloatArray]:
    return of.irradiance(np.array([[x, y, z]]), UP[None], samples)


def corner_rectangle(a: float, b: float, height: float) -> float:
    """Form factor from a point to the a x b rectangle parallel to it, one of whose corners is above it."""
    x, y = a / height, b / height
    p, q = math.hypot(1.0, x), math.hypot(1.0, y)
    return (x / p * math.atan(y / p) + y / q * math.atan(x / q)) / (2.0 * math.pi)


# --- many bounces ---


@pytest.mark.parametrize(
    ("albedo", "samples", "resolution"), [(0.5, 1 << 14, 0.01), (0.9, 1 << 14, 0.01), (0.99, 2048, 0.1)]
)
def test_white_furnace(albedo: float, samples: int, resolution: float) -> None:
    """In a closed box with a block in it, all of albedo rho and emission 1, B = 1 / (1 - rho) everywhere."""
    paint = material(albedo, 1.0)
    block = SceneObject("block", Mesh(0.3 + 0.25 * CUBE, OUTWARD), paint)
    furnace = tracer(SceneObject("box", Mesh(CUBE, INWARD), paint), block)
    mean, error = patch_irradiance(furnace, samples)
    assert_agrees(mean, error, 1.0 / (1.0 - albedo))
    assert (error * (1.0 - albedo)).max() < resolution, "too noisy to find anything"


def test_furnace_of_three_channels() -> None:
    """Channels share paths and roulette, and still each has its own answer."""
    albedo = np.array([0.2, 0.5, 0.8])
    furnace = tracer(SceneObject("box", Mesh(CUBE, INWARD), material(albedo.tolist(), (3.0, 2.0, 1.0))))
    mean, error = patch_irradiance(furnace, 8192)
    assert_agrees(mean, error, np.tile([3.0, 2.0, 1.0] / (1.0 - albedo), (6, 1)))


def test_furnace_of_light_from_one_lamp_obeys_energy() -> None:
    """All power that a lamp emits in a closed box is absorbed: the sum of (1 - rho) H A is that of E A."""
    of = cube([0.3, 0.5, 0.7, 0.2, 0.6, 0.4], [0.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    mean, error = patch_irradiance(of, 1 << 14)
    absorbing = 1.0 - of.surfaces.reflectance
    # Estimates of different patches are independent.
    total, noise = (absorbing * mean).sum(axis=0), np.sqrt(((absorbing * error) ** 2).sum(axis=0))
    assert_agrees(total, noise, 5.0)
    assert noise.max() < 0.02


def test_reference_cube_walls() -> None:
    of = cube(CASE["rho"], CASE["E"])
    mean, error = patch_irradiance(of, 1 << 16)
    assert_agrees(mean, error, np.array(CASE["true_mean_H"])[:, None], CASE["err_est"])
    lumped = (np.array(CASE["lumped_mean_B"]) - CASE["E"])[:, None] / 0.5
    assert (np.abs(mean - lumped) > 10 * error)[:2].all(), "one constant a wall would pass as well"


def test_reference_cube_points() -> None:
    def place(face: str, a: float, b: float) -> tuple[list[float], list[float]]:
        match face:
            case "floor":
                return [a, b, 0.0], [0.0, 0.0, 1.0]
            case "ceiling":
                return [a, b, 1.0], [0.0, 0.0, -1.0]
            case _:
                return [0.0, a, b], [1.0, 0.0, 0.0]

    cases = [
        (place(face, *(float(part) for part in key.strip("()").split(","))), point["value"])
        for face, points in CASE["point_H"].items()
        for key, point in points.items()
    ]
    of = cube(CASE["rho"], CASE["E"])
    positions = np.array([position for (position, _), _ in cases])
    normals = np.array([normal for (_, normal), _ in cases])
    mean, error = of.irradiance(positions, normals, 1 << 16)
    assert len(cases) == 13
    assert_agrees(mean, error, np.array([value for _, value in cases])[:, None], 1e-7)
    assert (error / mean).max() < 5e-3


# --- direct light, nothing reflects ---


@pytest.mark.parametrize("height", [0.05, 1.0, 20.0])
def test_point_below_a_corner_of_a_square_lamp(height: float) -> None:
    of = tracer(square("lamp", material(emission=4.0), z=height, down=True))
    mean, error = at_point(of, 0.0, 0.0, 0.0)
    assert_agrees(mean, error, 4.0 * corner_rectangle(1.0, 1.0, height))
    assert (error / mean).max() < 0.01


def test_screen_that_hides_half_of_the_lamp() -> None:
    """Below the lamp's edge, the screen hides what lies beyond half of its depth."""
    lamp = square("lamp", material(emission=4.0), z=1.0, down=True)
    screen = polygon("screen", [[0.25, -9, 0.5], [9, -9, 0.5], [9, 9, 0.5], [0.25, 9, 0.5]], material())
    mean, error = at_point(tracer(lamp, screen), 0.0, 0.0, 0.0)
    assert_agrees(mean, error, 4.0 * corner_rectangle(0.5, 1.0, 1.0))
    assert (error / mean).max() < 0.01


def test_mean_irradiance_of_opposite_and_adjacent_squares() -> None:
    """The adjacent one touches the lamp: the integrand is singular along their edge."""
    of = cube([0.0] * 6, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    mean, error = patch_irradiance(of, 1 << 15)
    truth = np.array([OPPOSITE, 0.0, ADJACENT, ADJACENT, ADJACENT, ADJACENT])
    assert_agrees(mean, error, truth[:, None])
    assert error[truth > 0.0].max() < 2e-3
    assert not mean[1].any(), "a plane lamp does not light itself"


def test_mean_irradiance_of_a_triangle_is_the_sum_over_its_parts() -> None:
    of = cube([0.5] * 6, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    floor = of.surfaces.corners[0]
    halves = floor[[[0, 1, 2, 2], [0, 2, 3, 3]]]
    mean, error = of.mean_irradiance(halves, np.array([3, 3], "i4"), np.array([0, 0], "i4"), 1 << 15)
    assert_agrees(mean.mean(axis=0), np.sqrt((error**2).sum(axis=0)) / 2.0, CASE["true_mean_H"][0])


def test_black_back_emits_nothing_and_blocks() -> None:
    of = tracer(
        square("lamp", material(emission=4.0), z=1.0), square("sky", material(emission=1.0), z=2.0, down=True)
    )
    mean, _ = at_point(of, 0.5, 0.5, 0.999)
    assert not mean.any()


def test_two_sided_lamp_emits_both_ways() -> None:
    of = tracer(square("lamp", material(emission=4.0, two_sided=True), z=1.0))
    positions = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    mean, error = of.irradiance(positions, np.array([UP, -UP]), 1 << 14)
    assert_agrees(mean, error, 4.0 * corner_rectangle(1.0, 1.0, 1.0))


def test_lamps_of_unlike_power_and_colour() -> None:
    """Light is sampled by power; what a colour gets must not depend on that."""
    of = tracer(
        square("strong", material(emission=(90.0, 30.0, 0.0)), z=2.0, down=True),
        polygon(
            "weak",
            [[0, 0, 1], [0, -1, 1], [-1, -1, 1], [-1, 0, 1]][::-1],
            material(emission=(0.0, 0.3, 1.0), two_sided=True),
        ),
    )
    mean, error = at_point(of, 0.0, 0.0, 0.0)
    strong, weak = corner_rectangle(1.0, 1.0, 2.0), corner_rectangle(1.0, 1.0, 1.0)
    assert_agrees(mean, error, np.array([[90.0 * strong, 30.0 * strong + 0.3 * weak, weak]]))


def test_no_light_and_no_scene_are_dark() -> None:
    for of in (tracer(square("floor", material(0.5), z=0.0)), tracer()):
        mean, error = at_point(of, 0.5, 0.5, 0.0, 64)
        assert not mean.any() and not error.any()
