"""What virtual lights add up to: right in the mean, by closed forms, and how fast they converge."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.illumination.particles.lights import VirtualLights, join_blocks
from solver.illumination.particles.path_numbers import PathPoints
from solver.illumination.particles.walk import WalkSettings, mean_reflectivity
from solver.pathtracing import PathTracer
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from tests.illumination.particles.rooms import (
    CEILING_LIGHT,
    CUBE,
    INWARD,
    UNBIASED,
    Room,
    cube,
    label,
    material,
    polygon,
    room,
    room_of,
    scatter,
    square,
)
from tests.illumination.particles.twin import irradiance_of
from tests.pathtracing.agreement import assert_agrees

CASE: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "data" / "reference" / "cube.json").read_text()
)["cases"]["A_uniform_rho_ceiling_light"]


def arriving(lights: VirtualLights, of: Room) -> FloatArray:
    """Mean irradiance (p, 3) that the lights tell of each patch, without a ray: what they reflect there."""
    s = of.surfaces
    again = lights.take(np.flatnonzero(lights.generation > 0))
    reflected = np.zeros((s.patch_count, 3))
    np.add.at(reflected, again.patch, again.power)
    return reflected / (s.reflectance * s.area[:, None])


# --- what they add up to ---


@pytest.mark.parametrize("settings", UNBIASED, ids=label)
@pytest.mark.parametrize("count", [3, 32])
def test_walls_receive_what_they_should(settings: WalkSettings, count: int) -> None:
    """However small blocks are, the mean over many is the exact irradiance of the walls."""
    found = [
        arriving(CEILING_LIGHT.block(count, seed, settings=settings), CEILING_LIGHT)[:, 0]
        for seed in range(6400 // count)
    ]
    mean, error = scatter(found)
    assert_agrees(mean, error, np.array(CASE["true_mean_H"]), CASE["err_est"], len(found))
    assert (error / mean).max() < 0.05


@pytest.mark.parametrize("settings", UNBIASED, ids=label)
def test_blocks_may_be_joined(settings: WalkSettings) -> None:
    """A frame refined from 4 to 32 paths and more by blocks that double: as right as one block of all."""
    blocks = [(0, 4), (4, 4), (8, 8), (16, 16)]
    found = [
        arriving(
            join_blocks([CEILING_LIGHT.block(n, seed, first, settings) for first, n in blocks]), CEILING_LIGHT
        )[:, 0]
        for seed in range(200)
    ]
    mean, error = scatter(found)
    assert_agrees(mean, error, np.array(CASE["true_mean_H"]), CASE["err_est"], len(found))
    assert (error / mean).max() < 0.05


@pytest.mark.parametrize("settings", UNBIASED, ids=label)
def test_energy_is_kept_where_nothing_is_like_the_mean(settings: WalkSettings) -> None:
    """All power that is emitted is absorbed, in three channels, in a room with a bright and a dark half."""
    walls = [material((rho, 0.5 * rho, 0.5)) for rho in (0.9, 0.1, 0.9, 0.05, 0.6, 0.2)]
    walls[1] = material((0.1, 0.05, 0.5), (4.0, 2.0, 1.0))
    of = cube(*walls)
    absorbing = (1.0 - of.surfaces.reflectance) * of.surfaces.area[:, None]
    found = [
        (absorbing * arriving(of.block(24, seed, settings=settings), of)).sum(axis=0) for seed in range(400)
    ]
    mean, error = scatter(found)
    assert_agrees(mean, error, np.array([4.0, 2.0, 1.0]), passes=len(found))
    assert (error / mean).max() < 0.04


def test_a_bright_corner_of_a_dark_scene_stays_bounded() -> None:
    """The tail survives by what it carries, not by the mean of 3 %: no light has more than all emit."""
    dark = square("dark", material(0.01), z=-9.0, low=-20.0, high=20.0)
    inner = [
        polygon(f"face{k}", CUBE[list(face)], material(0.9, 1.0 if k == 1 else 0.0))
        for k, face in enumerate(INWARD)
    ]
    of = room(dark, *inner)
    assert mean_reflectivity(of.surfaces) < 0.03
    found = [of.block(16, seed) for seed in range(200)]
    total = [arriving(lights, of)[1:, 0].sum() * 0.1 for lights in found]
    mean, error = scatter([np.array([one]) for one in total])
    assert_agrees(mean, error, 1.0, passes=len(found))
    assert max(lights.power.max() for lights in found) < 1.0


@pytest.mark.parametrize("settings", UNBIASED, ids=label)
def test_reference_cube_points(settings: WalkSettings) -> None:
    places = {"floor": ([0.5, 0.5, 0.0], [0, 0, 1]), "ceiling": ([0.5, 0.5, 1.0], [0, 0, -1])}
    places["wall_x0"] = ([0.0, 0.5, 0.5], [1, 0, 0])
    positions = np.array([position for position, _ in places.values()])
    normals = np.array([normal for _, normal in places.values()], dtype=float)
    truth = np.array([CASE["point_H"][face]["(0.5, 0.5)"]["value"] for face in places])
    found = [
        irradiance_of(CEILING_LIGHT.block(128, seed, settings=settings), positions, normals, CEILING_LIGHT)
        for seed in range(40)
    ]
    mean, error = scatter([one[:, 0] for one in found])
    assert_agrees(mean, error, truth, passes=len(found))
    assert (error / mean).max() < 0.04


@pytest.mark.parametrize("albedo", [0.3, 0.8])
def test_white_furnace(albedo: float) -> None:
    """Everything emits 1 and reflects rho: irradiance is 1 / (1 - rho), on walls and in between."""
    of = cube(material(albedo, 1.0))
    positions = np.array([[0.5, 0.5, 0.0], [0.0, 0.4, 0.6], [0.5, 0.5, 0.5]])
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.6, 0.0, 0.8]])
    found = [irradiance_of(of.block(256, seed), positions, normals, of)[:, 0] for seed in range(30)]
    mean, error = scatter(found)
    assert_agrees(mean, error, 1.0 / (1.0 - albedo), passes=len(found))
    assert (error / mean).max() < 0.02


def corner_rectangle(a: float, b: float, height: float) -> float:
    """Form factor of a point to the a x b rectangle parallel to it, one of whose corners is above it."""
    x, y = a / height, b / height
    p, q = math.hypot(1.0, x), math.hypot(1.0, y)
    return (x / p * math.atan(y / p) + y / q * math.atan(x / q)) / (2.0 * math.pi)


@pytest.mark.parametrize("height", [0.3, 1.0, 20.0])
def test_direct_light_of_a_square_lamp(height: float) -> None:
    of = room(square("lamp", material(0.0, 4.0), z=height, down=True))
    up = np.array([[0.0, 0.0, 1.0]])
    found = irradiance_of(of.block(4096), np.zeros((1, 3)), up, of)
    assert found[0, 0] == pytest.approx(4.0 * corner_rectangle(1.0, 1.0, height), rel=3e-3)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 7.5, 60.0])
def test_direct_light_of_directional_lamps(exponent: float) -> None:
    """Small from afar, L = E (d + 2) / (2 pi) cos^d: irradiance is E A (d + 2) / (2 pi) cos^(d + 1) / r^2."""
    lamp = square("lamp", material(0.0, 9.0, emission_exponent=exponent), z=0.0, low=-0.002, high=0.002)
    of = room(lamp, square("far", material(), z=-9.0))
    angle = np.radians([0.0, 10.0, 40.0])
    positions = 2.0 * np.stack([np.sin(angle), np.zeros(3), np.cos(angle)], axis=1)
    found = irradiance_of(of.block(256), positions, np.tile([0.0, 0.0, -1.0], (3, 1)), of)[:, 0]
    power = 9.0 * 0.004**2
    cosine = np.cos(angle)
    expected = power * (exponent + 2.0) / (2.0 * math.pi) * cosine ** (exponent + 1.0) * cosine / 4.0
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def test_directional_lamps_send_paths_where_they_shine() -> None:
    """cos^d light on a sphere's worth of floor: the share within an angle of the axis is 1 - cos^(d + 2)."""
    exponent = 5.0
    of = room(
        square("lamp", material(0.0, 1.0, emission_exponent=exponent), z=0.0, low=-0.001, high=0.001),
        square("sky", material(0.5), z=1.0, down=True, low=-50.0, high=50.0),
    )
    lights = of.block(4096)
    assert np.all(lights.lobe[lights.generation == 0] == exponent + 1.0)
    cosine = lights.incident[lights.generation == 1, 2]
    for bound in (0.95, 0.8, 0.5):
        assert np.mean(cosine > bound) == pytest.approx(1.0 - bound ** (exponent + 2.0), abs=0.01)


# --- how fast they converge ---


def observers() -> tuple[Room, FloatArray, FloatArray]:
    """Points in the air of the Cornell box, away from what shines on them, and their normals."""
    of = room_of(load_sample("cornell"))
    s = of.surfaces
    random = np.random.default_rng(5)
    low, high = s.corners.reshape(-1, 3).min(axis=0), s.corners.reshape(-1, 3).max(axis=0)
    points = low + (high - low) * random.uniform(0.1, 0.9, (600, 3))
    ways = random.standard_normal((100, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    hits = of.rays.intersect(np.repeat(points, 100, axis=0), np.tile(ways, (600, 1)))
    clear = hits.distance.reshape(600, 100).min(axis=1) > 0.12 * s.size
    return of, points[clear][:24], ways[:24]


def slope(counts: list[int], errors: list[float]) -> float:
    return float(np.polyfit(np.log(counts), np.log(errors), 1)[0])


def test_all_light_in_the_cornell_box_converges_faster_than_by_chance() -> None:
    """Against the path tracer, which shares only rays: errors fall faster than N^(-1/2), and are lower."""
    of, points, normals = observers()
    truth, _ = PathTracer(of.surfaces, of.rays, 1).irradiance(points, normals, 1 << 15)
    counts = [32, 64, 128, 256, 512]

    def error(kind: PathPoints, count: int) -> float:
        off = [
            (irradiance_of(of.block(count, seed, settings=WalkSettings(kind)), points, normals, of) - truth)
            @ LUMINANCE_WEIGHTS
            for seed in range(12)
        ]
        return float(np.sqrt(np.mean(np.square(off)) / np.mean((truth @ LUMINANCE_WEIGHTS) ** 2)))

    errors = {kind: [error(kind, count) for count in counts] for kind in PathPoints}
    assert errors[PathPoints.SCRAMBLED][-1] < 0.03
    assert slope(counts, errors[PathPoints.SCRAMBLED]) < -0.5
    assert np.all(np.array(errors[PathPoints.SCRAMBLED]) < 0.9 * np.array(errors[PathPoints.RANDOM]))
    assert np.all(np.array(errors[PathPoints.JITTERED][1:]) < np.array(errors[PathPoints.RANDOM][1:]))


@pytest.mark.slow
def test_low_discrepancy_helps_the_first_generations_most() -> None:
    """Direct light converges about as 1 / N, once reflected light as N^(-2/3); random numbers as N^(-1/2)."""
    of, points, normals = observers()

    def irradiance(settings: WalkSettings, count: int, seed: int) -> FloatArray:
        lights = of.block(count, seed, settings=settings)
        return np.array(
            [
                irradiance_of(lights.take(np.flatnonzero(lights.generation == g)), points, normals, of)
                @ LUMINANCE_WEIGHTS
                for g in range(2)
            ]
        )

    truth = np.mean([irradiance(WalkSettings(), 1 << 15, 1000 + seed) for seed in range(4)], axis=0)
    counts = [32, 64, 128, 256, 512, 1024]
    slopes = {}
    for kind in PathPoints:
        errors = [
            np.sqrt(
                np.mean([(irradiance(WalkSettings(kind), n, s) - truth) ** 2 for s in range(10)], axis=(0, 2))
            )
            for n in counts
        ]
        slopes[kind] = [slope(counts, [float(error[g]) for error in errors]) for g in range(2)]
    assert slopes[PathPoints.SCRAMBLED][0] < -0.8 and slopes[PathPoints.SCRAMBLED][1] < -0.6
    assert slopes[PathPoints.JITTERED][0] < -0.75
    assert slopes[PathPoints.RANDOM] == pytest.approx([-0.5, -0.5], abs=0.08)
