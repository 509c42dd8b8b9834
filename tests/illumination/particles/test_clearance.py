"""Lights that touch walls: on their side they shine as ever, and on the other not at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.illumination.particles.clearance import CLEARANCE, clear_of_walls
from solver.illumination.particles.lights import VirtualLights
from solver.types import FloatArray
from tests.illumination.particles.rooms import Room, cube, material, polygon, room
from tests.illumination.particles.shining import gains, lamps, patch_at, spread

GREY = material(0.5)
UP = np.array([0.0, 0.0, 1.0])
WALL = 0.37
"""Where a wall across the unit cube is, which is no number of few digits"""


def walled(two_sided: bool = True, slant: float = 0.0) -> Room:
    """A cube with a wall across it, upright or slanting, on a floor that goes through under it."""
    top = WALL + slant
    across = [[WALL, 0, 0], [WALL, 1, 0], [top, 1, 1], [top, 0, 1]]
    sides = cube(GREY).surfaces.corners
    return room(
        *(polygon(f"side{k}", sides[k], GREY) for k in range(6)),
        polygon("wall", across, material(0.5, two_sided=two_sided)),
    )


def beside(of: Room, apart: FloatArray) -> VirtualLights:
    """Lights on the floor, so far behind the wall's foot, metres."""
    y = np.linspace(0.11, 0.87, len(apart))
    lights = lamps(np.column_stack([WALL + apart, y, np.zeros(len(apart))]), UP)
    return replace(lights, patch=np.full(len(apart), floor_at(of, 0.9), dtype=np.int32))


def floor_at(of: Room, x: float) -> int:
    """The floor's patch around x."""
    s = of.surfaces
    low, high = s.corners[:, :, 0].min(axis=1), s.corners[:, :, 0].max(axis=1)
    (found,) = np.flatnonzero((s.normal[:, 2] > 0.99) & (low < x) & (x < high) & (s.corners[:, 0, 2] == 0.0))
    return int(found)


@pytest.mark.parametrize("resolution", [16, 128])
@pytest.mark.parametrize("slant", [0.0, 0.3, -0.3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_nothing_leaks_however_near_a_light_is_to_a_wall(sign: float, slant: float, resolution: int) -> None:
    """From 1e-5 to 1e-9 of the scene's size, before it and behind."""
    of = walled(slant=slant)
    apart = sign * np.logspace(-5, -9, 9) * of.surfaces.size
    positions, patch = spread(of, 400)
    # How far right of the wall, and off all planes that float32 takes receivers for being on.
    right = positions[:, 0] - WALL - slant * positions[:, 2]
    off = np.abs(right) > 1e-4
    positions, patch, right = positions[off], patch[off], right[off]
    lights = clear_of_walls(beside(of, apart), of.surfaces)
    assert np.abs(lights.position[:, 0] - WALL - apart).max() <= 2.0 * CLEARANCE * of.surfaces.size
    np.testing.assert_array_equal(lights.position[:, 2], 0.0)
    found = gains(of, lights, positions, patch, resolution, bound=25.0)
    assert not found[:, sign * right < 0.0].any()
    reference = beside(of, np.full(9, sign * 3e-5 * of.surfaces.size))
    expected = gains(of, reference, positions, patch, resolution, bound=25.0)
    np.testing.assert_allclose(found, expected, atol=2e-3 * expected.max())
    assert np.mean(found[:, sign * right > 0.0] > 0.0) > 0.5


def test_a_light_on_the_plane_stays_with_its_patch() -> None:
    """Two floors that meet under the wall: to float64 their lights are in one place."""
    sides = cube(GREY).surfaces.corners
    left = np.array([[0, 0, 0], [WALL, 0, 0], [WALL, 1, 0], [0, 1, 0]])
    rest = np.array([[WALL, 0, 0], [1, 0, 0], [1, 1, 0], [WALL, 1, 0]])
    of = room(
        *(polygon(f"side{k}", sides[k], GREY) for k in range(1, 6)),
        polygon("left", left, GREY),
        polygon("right", rest, GREY),
        polygon("wall", [[WALL, 0, 0], [WALL, 1, 0], [WALL, 1, 1], [WALL, 0, 1]], GREY),
    )
    for x, side in ((0.1, -1.0), (0.9, 1.0)):
        for error in (-1e-10, 0.0, 1e-10):
            lights = beside(of, np.array([error]))
            owned = replace(lights, patch=np.array([floor_at(of, x)], dtype=np.int32))
            moved = clear_of_walls(owned, of.surfaces).position[0, 0]
            assert side * (moved - WALL) == pytest.approx(CLEARANCE * of.surfaces.size, rel=1e-6)


def test_corners_are_left_both_ways() -> None:
    of = cube(GREY)
    size = of.surfaces.size
    lights = lamps(np.array([[1e-9, 1e-8, 0.0], [1.0 - 1e-8, 0.5, 0.0]]), UP)
    lights = replace(lights, patch=np.full(2, patch_at(of, (0.5, 0.5, 0.0), (0, 0, 1)), dtype=np.int32))
    expected = [[CLEARANCE * size, CLEARANCE * size, 0.0], [1.0 - CLEARANCE * size, 0.5, 0.0]]
    np.testing.assert_allclose(clear_of_walls(lights, of.surfaces).position, expected, atol=1e-12)


def test_lights_off_walls_and_images_stay_where_they_are() -> None:
    of = walled()
    lights = beside(of, np.array([1e-3, -1e-3, 0.2]))
    np.testing.assert_array_equal(clear_of_walls(lights, of.surfaces).position, lights.position)
    images = replace(beside(of, np.array([1e-8])), mirror=np.zeros(1, dtype=np.int32))
    np.testing.assert_array_equal(clear_of_walls(images, of.surfaces).position, images.position)
