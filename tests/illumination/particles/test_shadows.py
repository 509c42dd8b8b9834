"""Shadows by maps of polygons: exact edges, no leaks through walls, and nothing that shadows itself."""

from __future__ import annotations

import numpy as np
import pytest

from solver.illumination.particles.lights import VirtualLights
from solver.types import IntArray, Points
from tests.illumination.particles.rooms import Room, cube, material, polygon, room, square
from tests.illumination.particles.shining import block, gains, lamps, patch_at, true_gains

WHITE = material(0.5)
DOWN = np.array([0.0, 0.0, -1.0])


@pytest.mark.parametrize("resolution", [16, 128])
def test_the_edge_of_a_shadow_is_where_it_should_be(resolution: int) -> None:
    """Half of a ceiling's light is cut off by a board: the line is found by bisection, to some 1e-7."""
    random = np.random.default_rng(5)
    turn = random.uniform(0.0, 2.0 * np.pi)
    across, along = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([-np.sin(turn), np.cos(turn), 0.0])
    edge = np.array([0.1, -0.05, 0.6])
    ends = [edge + 9.0 * s * along + 9.0 * t * across for s, t in ((-1, 0), (1, 0), (1, -1), (-1, -1))]
    board = polygon("board", np.array(ends), material(0.5, two_sided=True))
    floor = square("floor", WHITE, z=0.0, low=-9.0, high=9.0)
    of = room(floor, board)
    lights = lamps(np.column_stack([random.uniform(-0.4, 0.4, (12, 2)), np.full(12, 1.5)]), DOWN)
    low, high = np.full((12, 20), -3.0), np.full((12, 20), 3.0)
    place = random.uniform(-0.3, 0.3, 20)
    patch = np.full(20, patch_at(of, (0, 0, 0), (0, 0, 1)), dtype=np.int32)
    for _ in range(34):
        middle = 0.5 * (low + high)
        for k in range(12):
            points = middle[k, :, None] * across + place[:, None] * along
            dark = gains(of, lights.take(np.array([k])), points, patch, resolution)[0] == 0.0
            low[k], high[k] = np.where(dark, middle[k], low[k]), np.where(dark, high[k], middle[k])
    at = lights.position @ across
    expected = at + (edge @ across - at) * 1.5 / (1.5 - 0.6)
    np.testing.assert_allclose(high, expected[:, None] * np.ones(20), atol=3e-7 * of.surfaces.size)


@pytest.mark.parametrize("resolution", [16, 128])
@pytest.mark.parametrize("thickness", [0.0, 0.001, 0.02])
def test_a_wall_between_two_halves_of_a_room_leaks_nothing(thickness: float, resolution: int) -> None:
    """Of 2 cm in 10 m, and less: from lights beside it to receivers beside it, in corners too."""
    wall = (
        block("wall", WHITE, (5.0 - thickness, 0.0, 0.0), (5.0, 10.0, 10.0))
        if thickness > 0.0
        else polygon("wall", [[5, 0, 0], [5, 10, 0], [5, 10, 10], [5, 0, 10]], material(0.5, two_sided=True))
    )
    of = room(block("room", WHITE, (0, 0, 0), (10, 10, 10), inward=True), wall)
    lights, (positions, patch) = on_the_left(5.0 - thickness), on_the_right(of)
    leaked = gains(of, lights, positions, patch, resolution)
    light, point = np.nonzero(leaked)
    # What is left grazes the light's own surface, nearer to it than the middles of a map's last texels.
    out = positions[point] - lights.position[light]
    cosine = np.einsum("ka,ka->k", out, lights.normal[light]) / np.linalg.norm(out, axis=1)
    assert np.all(cosine < 1.0 / resolution)
    assert leaked.mean() < 1e-4 / (np.pi * 5.0**2), "of what arrives from 5 m away"


NEAR = np.array([1e-4, 1e-3, 0.01, 0.1, 1.0, 3.0])


def on_the_left(x: float) -> VirtualLights:
    """Lights on floor, ceiling and the wall at x, many of them in corners."""
    random = np.random.default_rng(1)
    near, y = x - np.tile(NEAR, 3), random.uniform(0.01, 9.99, 18)
    y[::5] = 1e-4
    z = np.concatenate([NEAR, 10.0 - NEAR, random.uniform(0.0, 10.0, 6)])
    floor, wall = np.stack([near, y, np.zeros(18)], 1), np.stack([np.full(18, x), y, z], 1)
    ceiling = floor + np.array([0.0, 0.0, 10.0])
    normals = np.repeat([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]], 18, axis=0)
    return lamps(np.concatenate([floor, ceiling, wall]), normals)


def on_the_right(of: Room) -> tuple[Points, IntArray]:
    """Points beyond the wall at x = 5, on it, on floor, ceiling and a side, many of them in corners."""
    random = np.random.default_rng(2)
    near, y = 5.0 + np.tile(NEAR, 20), random.uniform(0.0, 10.0, 120)
    y[::7] = 1e-4
    z = np.concatenate([np.tile(NEAR, 5), 10.0 - np.tile(NEAR, 5), random.uniform(0.0, 10.0, 60)])
    none, five = np.zeros(120), np.full(120, 5.0)
    points = [[near, y, none], [near, y, none + 10.0], [five, y, z], [near, none, z]]
    on = [
        patch_at(of, at, normal)
        for at, normal in (
            ((6, 1, 0), (0, 0, 1)),
            ((6, 1, 10), (0, 0, -1)),
            ((5, 1, 1), (1, 0, 0)),
            ((6, 0, 1), (0, 1, 0)),
        )
    ]
    return np.concatenate([np.stack(p, 1) for p in points]), np.repeat(on, 120).astype(np.int32)


def test_light_gets_past_the_end_of_a_wall_by_a_texel_at_most() -> None:
    """A wall of 2 cm that ends halfway up: from a light above it, its top is smaller than a texel."""
    of = room(
        block("room", WHITE, (0, 0, 0), (10, 10, 10), inward=True),
        block("wall", WHITE, (4.98, 0, 0), (5, 10, 7)),
    )
    lights, (positions, patch) = on_the_left(4.98), on_the_right(of)
    found, truth = gains(of, lights, positions, patch), true_gains(of, lights, positions, patch)
    assert not np.any((found == 0.0) & (truth > 1e-9 * truth.max()))
    leaks = np.argwhere((found > 0.0) & (truth == 0.0) & (found > 1e-6))
    light, point = lights.position[leaks[:, 0]], positions[leaks[:, 1]]
    to_end = np.stack([5.0 - light[:, 0], 7.0 - light[:, 2]], axis=1)
    to_point = (point - light)[:, [0, 2]]
    turn = np.abs(np.arctan2(to_end[:, 0], to_end[:, 1]) - np.arctan2(to_point[:, 0], to_point[:, 1]))
    texel = np.sqrt(1.7 * 2.0 * np.pi) / 128
    assert turn.max() < 2.0 * texel


# --- nothing shadows itself ---


def test_an_empty_room_has_no_dark_points() -> None:
    """Up to its edges and corners: every point gets what the closed form says from every light."""
    of = cube(WHITE)
    random, s = np.random.default_rng(4), of.surfaces
    near = np.concatenate([np.zeros(4), 10.0 ** np.arange(-8, -1), random.random(9)])
    near = np.concatenate([near, 1.0 - near])
    u, v = (axis.ravel() for axis in np.meshgrid(near, near))
    positions, patch = [], []
    for p in range(6):
        a, b, _, d = s.corners[p]
        positions.append(a + u[:, None] * (b - a) + v[:, None] * (d - a))
        patch.append(np.full(len(u), p, dtype=np.int32))
    points, on = np.concatenate(positions), np.concatenate(patch)
    lights = of_all_walls(of, random)
    found = gains(of, lights, points, on)
    apart = points - lights.position[:, None]
    there = np.einsum("mna,ma->mn", apart, lights.normal)
    here = -np.einsum("mna,na->mn", apart, s.normal[on])
    square = np.einsum("mna,mna->mn", apart, apart)
    expected = np.maximum(here, 0.0) * np.maximum(there, 0.0) / square**2 / np.pi
    clear = (here > 1e-6) & (there > 1e-6)
    assert clear.mean() > 0.6
    assert np.all(found[clear] > 0.0)
    clear &= np.minimum(here, there) > 1e-4
    np.testing.assert_allclose(found[clear], expected[clear], rtol=3e-3)


def of_all_walls(of: Room, random: np.random.Generator) -> VirtualLights:
    """Lights on all faces of the unit cube, some of them near edges."""
    s = of.surfaces
    share = random.random((6, 8, 2, 1))
    share[:, :3, 0] *= 1e-3
    a, b, d = (s.corners[:, None, k] for k in (0, 1, 3))
    at = a + share[:, :, 0] * (b - a) + share[:, :, 1] * (d - a)
    return lamps(at.reshape(-1, 3), np.repeat(s.normal, 8, axis=0))


def test_what_stands_on_a_floor_shadows_it_up_to_its_foot() -> None:
    """No light under a crate, and none missing beside it, from 1e-4 of the room on."""
    crate = block("crate", WHITE, (0.4, 0.4, 0.0), (0.6, 0.6, 0.3))
    of = room(block("room", WHITE, (0, 0, 0), (1, 1, 1), inward=True), crate)
    floor = patch_at(of, (0.1, 0.1, 0.0), (0, 0, 1))
    random = np.random.default_rng(6)
    lights = lamps(np.column_stack([random.random((20, 2)), np.ones(20)]), DOWN)
    outside = np.tile(10.0 ** -np.linspace(1.0, 4.0, 30), 4)
    side, along = np.repeat(np.arange(4), 30), random.uniform(0.4, 0.6, 120)
    x = np.choose(side, [0.4 - outside, 0.6 + outside, along, along])
    y = np.choose(side, [along, along, 0.4 - outside, 0.6 + outside])
    beside = np.stack([x, y, np.zeros(120)], axis=1)
    patch = np.full(120, floor, dtype=np.int32)
    found, truth = gains(of, lights, beside, patch), true_gains(of, lights, beside, patch)
    assert not np.any((found == 0.0) & (truth > 0.0))
    assert np.mean((found > 0.0) & (truth == 0.0)) < 1e-3, "corners of the crate fall between texels"
    below = np.column_stack([random.uniform(0.401, 0.599, (120, 2)), np.zeros(120)])
    assert not gains(of, lights, below, patch).any()
