"""Bounded lights and what is put back: together what lights without a bound give, in the mean."""

from __future__ import annotations

import numpy as np
import pytest

from solver.illumination.particles.compensation import NearbyLight
from solver.illumination.particles.lighting import add_light
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.sights import look_around
from solver.types import Float32Array, FloatArray, Int64Array, IntArray, Points
from tests.illumination.particles.rooms import Room, cube, material, polygon, room, scatter, square
from tests.illumination.particles.shining import patch_at, shining_of, spread
from tests.pathtracing.agreement import assert_agrees

HEIGHTS = np.array([0.02, 0.1, 0.3, 0.8])
"""Distances of the points from the corner, m"""
TURNS = 64
"""Rays of a pixel that make an estimate"""


def corner(reflectance: float, emission: float) -> Room:
    """A square floor that meets a square wall along the axis y; the wall emits, or reflects."""
    wall = polygon("wall", [[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]], material(reflectance, emission))
    return room(square("floor", material(0.5), z=0.0), wall)


def factor(x: FloatArray) -> FloatArray:
    """Form factor to the wall of points (n,) of the floor, halfway along, x from the corner."""
    # Twice that of a rectangle a quarter of whose corner the point faces: Lambert's sum over its edges.
    half, high = 0.5, 1.0
    slant = np.hypot(x, high)
    return np.asarray((np.arctan(half / x) - x / slant * np.arctan(half / slant)) / np.pi)


def bounded_factor(of: Room, x: FloatArray, bound: float) -> FloatArray:
    """The same with cos cos' / r^2 bounded, by the midpoints of 800 x 800 squares."""
    at = (np.arange(800) + 0.5) / 800
    y, z = np.meshgrid(at - 0.5, at)
    most = bound / of.surfaces.size**2
    return np.array(
        [np.minimum(x_ * z / (x_**2 + y**2 + z**2) ** 2, most).mean() / np.pi for x_ in x.tolist()]
    )


def points_of(of: Room, x: FloatArray) -> tuple[Points, IntArray]:
    floor = patch_at(of, (0.5, 0.5, 0.0), (0, 0, 1))
    return (
        np.column_stack([x, np.full(len(x), 0.5), np.zeros(len(x))]),
        np.full(len(x), floor, dtype=np.int32),
    )


def by_lights(
    of: Room, paths: int, seed: int, bound: float, positions: Points, patch: IntArray, resolution: int = 32
) -> Float32Array:
    """Irradiance (3, n) by the bounded lights of a block."""
    polygons = Polygons.of(of.surfaces)
    shining = shining_of(polygons, of.block(paths, seed))
    sights = look_around(of.rays, polygons, shining.frames, resolution)
    light = np.zeros((3, len(patch)), dtype=np.float32)
    add_light(light, Receivers.on(polygons, positions, patch), shining, sights, bound)
    return light


def no_light(receivers: Receivers, turn: int) -> Float32Array:
    return np.zeros((3, len(receivers)), dtype=np.float32)


def nearby(of: Room, bound: float) -> NearbyLight:
    """Of lamps alone."""
    return NearbyLight(of.surfaces, Polygons.of(of.surfaces), of.rays, bound, no_light, None)


def compensation(near: NearbyLight, positions: Points, patch: IntArray, streams: int) -> list[FloatArray]:
    """Independent estimates (n,), in the first channel."""
    count, found = len(patch), np.zeros((streams, len(patch)))
    many = np.tile(positions, (streams, 1)), np.tile(patch, streams)
    stream: Int64Array = np.arange(streams * count, dtype=np.int64)
    for turn in range(TURNS):
        found += near.at(*many, stream, turn)[0].reshape(streams, count) / TURNS
    return list(found)


def test_the_closed_forms_agree() -> None:
    x = np.array([0.1, 0.5])
    np.testing.assert_allclose(factor(x), bounded_factor(corner(0.0, 1.0), x, np.inf), rtol=1e-4)


@pytest.mark.parametrize("bound", [2.0, 25.0, 400.0])
def test_what_is_put_back_is_what_the_bound_takes_away(bound: float) -> None:
    """From a lamp that meets the floor: each part by itself, and their sum, by closed forms."""
    of = corner(0.0, 3.0)
    positions, patch = points_of(of, HEIGHTS)
    exact, left = 3.0 * factor(HEIGHTS), 3.0 * bounded_factor(of, HEIGHTS, bound)
    lit = [by_lights(of, 256, seed, bound, positions, patch)[0].astype(float) for seed in range(40)]
    back = compensation(nearby(of, bound), positions, patch, 40)
    assert_agrees(*scatter(lit), left, passes=40)
    assert_agrees(*scatter(back), exact - left, 1e-5, passes=40)
    mean, error = scatter([a + b for a, b in zip(lit, back, strict=True)])
    assert np.all(error < 0.03 * exact), "so that bias would show"
    assert np.all(np.abs(mean - exact) < 3.0 * error + 1e-5)
    # Without, it is darker the nearer the corner is, down to what the closed form says.
    assert lit[0][0] < 0.8 * exact[0] or bound > 100.0


def test_an_infinite_bound_takes_nothing_away() -> None:
    of = corner(0.0, 1.0)
    positions, patch = points_of(of, HEIGHTS)
    stream = np.arange(len(patch), dtype=np.int64)
    assert not nearby(of, np.inf).at(positions, patch, stream, 0).any()
    none = nearby(of, 10.0).at(positions[:0], patch[:0], stream[:0], 0)
    assert none.shape == (3, 0)


def test_bounds_near_zero_put_all_light_back() -> None:
    """Rays then reach all of the scene: plain sampling of the cosine."""
    of = corner(0.0, 1.0)
    positions, patch = points_of(of, HEIGHTS)
    back = compensation(nearby(of, 1e-3), positions, patch, 40)
    left = bounded_factor(of, HEIGHTS, 1e-3)
    assert left.max() < 1e-3
    assert_agrees(*scatter(back), factor(HEIGHTS) - left, 1e-5, passes=40)


def test_backs_of_one_sided_faces_give_nothing_back() -> None:
    of = room(
        square("floor", material(0.5), z=0.0),
        polygon("wall", [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]], material(0.5, 1.0)),
    )
    positions, patch = points_of(of, HEIGHTS)
    assert not np.any(compensation(nearby(of, 10.0), positions, patch, 4))


@pytest.mark.parametrize("bound", [5.0, 100.0])
def test_known_light_is_reflected(bound: float) -> None:
    """A wall of reflectance 0.4 that is known to receive 5, 3 and 1: as if it emitted 0.4 times that."""
    of = corner(0.4, 0.0)
    asked: list[IntArray] = []

    def known(positions: Points, patch: IntArray) -> FloatArray:
        asked.append(patch)
        assert np.all(np.abs(positions[:, 0]) < 1e-5), "it is asked on the wall"
        return np.tile([5.0, 3.0, 1.0], (len(patch), 1))

    near = NearbyLight(of.surfaces, Polygons.of(of.surfaces), of.rays, bound, no_light, known)
    positions, patch = points_of(of, HEIGHTS)
    expected = 2.0 * (factor(HEIGHTS) - bounded_factor(of, HEIGHTS, bound))
    assert_agrees(*scatter(compensation(near, positions, patch, 40)), expected, 1e-5, passes=40)
    assert set(np.concatenate(asked).tolist()) == {patch_at(of, (0.0, 0.5, 0.5), (1, 0, 0))}
    light = near.at(positions, patch, np.arange(len(patch), dtype=np.int64), 3)
    np.testing.assert_allclose(light[1:], light[0] * [[0.6], [0.2]], rtol=1e-5)


def test_lobes_of_lamps_count() -> None:
    """A wall that emits by cos^2 of the angle: (d + 2) / 2 cos^2 of what a diffuse one gives."""
    wall = polygon(
        "wall", [[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]], material(0.0, 1.0, emission_exponent=2.0)
    )
    of = room(square("floor", material(0.0), z=0.0), wall)
    positions, patch = points_of(of, HEIGHTS)
    at = (np.arange(800) + 0.5) / 800
    y, z = np.meshgrid(at - 0.5, at)
    most = 3.0 / of.surfaces.size**2
    expected = []
    for x in HEIGHTS.tolist():
        square_ = x**2 + y**2 + z**2
        kernel = x * z / square_**2
        share = np.maximum(1.0 - most / kernel, 0.0)
        expected.append((share * kernel * 2.0 * x**2 / square_).mean() / np.pi)
    back = compensation(nearby(of, 3.0), positions, patch, 40)
    assert_agrees(*scatter(back), np.array(expected), 1e-4, passes=40)


@pytest.mark.parametrize("bound", [3.0, 30.0])
def test_a_furnace_stays_as_bright_everywhere(bound: float) -> None:
    """All of one material, closed: irradiance is 2 everywhere, also where rays meet corners again."""
    of = cube(material(0.5, 1.0))
    polygons = Polygons.of(of.surfaces)
    positions, patch = spread(of, 400)
    positions[:200] = np.where(positions[:200] < 0.5, 0.1 * positions[:200], positions[:200])
    found = []
    for seed in range(24):
        shining = shining_of(polygons, of.block(64, seed))
        sights = look_around(of.rays, polygons, shining.frames, 16)

        def shine(receivers: Receivers, turn: int) -> Float32Array:
            light = np.zeros((3, len(receivers)), dtype=np.float32)
            add_light(light, receivers, shining, sights, bound)  # noqa: B023
            return light

        near = NearbyLight(of.surfaces, polygons, of.rays, bound, shine, None)
        light = shine(Receivers.on(polygons, positions, patch), 0)
        stream = np.arange(400, dtype=np.int64) + 400 * seed
        for turn in range(4):
            light += near.at(positions, patch, stream, turn) / 4
        found.append(np.array([light[0, :200].mean(), light[0, 200:].mean()]))
    mean, error = scatter(found)
    assert np.all(error < 0.02)
    assert np.all(np.abs(mean - 2.0) < 3.0 * error)
