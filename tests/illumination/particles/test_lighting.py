"""Light by virtual lights with shadows: against a ray for each light and point, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.geometry.scene import Mesh, SceneObject
from solver.illumination.particles.lighting import BLOCK, ShiningLights, add_light
from solver.illumination.particles.lights import VirtualLights
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.sights import look_around
from solver.types import Float32Array, FloatArray
from tests.illumination.particles.rooms import (
    Room,
    cube,
    material,
    room,
    room_of,
    square,
)
from tests.illumination.particles.shining import gains, lamps, patch_at, shining_of, spread, true_gains

WHITE = material(0.5)
UP, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])


def few(of: Room, count: int, most: int = 30) -> VirtualLights:
    """Some of the lights of a block."""
    lights = of.block(count)
    return lights.take(np.arange(0, len(lights), -(-len(lights) // most)))


# --- against rays ---


@pytest.mark.parametrize(("name", "most"), [("cornell", 0.002), ("office", 0.01)])
def test_light_of_samples_is_that_of_rays(name: str, most: float) -> None:
    """It is never dark where it should not be, and what leaks in between texels is less with more of them."""
    of = room_of(load_sample(name))
    lights, (positions, patch) = few(of, 24), spread(of, 1500)
    truth = true_gains(of, lights, positions, patch)
    resolutions, errors = [8, 16, 32, 64, 128], []
    for resolution in resolutions:
        found = gains(of, lights, positions, patch, resolution)
        assert np.sum((found == 0.0) & (truth > 1e-6 * truth.max())) == 0, "wrongly dark"
        lit = (found > 0.0) & (truth > 0.0)
        np.testing.assert_allclose(found[lit], truth[lit], rtol=1e-3, atol=1e-6 * truth.max())
        off, all_light = (found - truth).sum(axis=0), truth.sum(axis=0)
        errors.append(np.sqrt(np.sum(off**2) / np.sum(all_light**2)))
    assert errors[-1] < most
    slope = np.polyfit(np.log(resolutions), np.log(np.maximum(errors, 1e-6)), 1)[0]
    assert slope < -1.0, errors


def test_order_and_company_of_receivers_do_not_matter() -> None:
    """Blocks of receivers are left out whole where they can have no light: none of it may be lost so."""
    of = room_of(load_sample("office"))
    polygons, lights = Polygons.of(of.surfaces), few(of, 24)
    positions, patch = spread(of, 3 * BLOCK + 17)
    by_patch = np.argsort(patch, kind="stable")
    shuffled = np.random.default_rng(2).permutation(len(patch))
    found = []
    for order in (by_patch, shuffled):
        receivers = Receivers.on(polygons, positions[order], patch[order])
        light = np.empty((3, len(order)), dtype=np.float32)
        light[:, order] = lit(polygons, of, lights, receivers)
        found.append(light)
    np.testing.assert_array_equal(found[0], found[1])


def lit(
    polygons: Polygons, of: Room, lights: VirtualLights, receivers: Receivers, bound: float = np.inf
) -> Float32Array:
    """Irradiance (3, n) by all lights."""
    shining = shining_of(polygons, lights)
    light = np.zeros((3, len(receivers)), dtype=np.float32)
    add_light(light, receivers, shining, look_around(of.rays, polygons, shining.frames), bound)
    return light


def test_light_is_added_to_what_is_there() -> None:
    of = cube(WHITE)
    polygons, lights = Polygons.of(of.surfaces), few(cube(material(0.5, (1.0, 2.0, 3.0))), 16)
    receivers = Receivers.on(polygons, *spread(of, 300))
    shining = shining_of(polygons, lights)
    sights = look_around(of.rays, polygons, shining.frames)
    whole = np.full((3, 300), 7.0, dtype=np.float32)
    add_light(whole, receivers, shining, sights, np.inf)
    parts = np.full((3, 300), 7.0, dtype=np.float32)
    for first in range(0, len(lights), 5):
        part, seen = (
            shining.part(first, first + 5).scaled(2.0),
            sights.part(first, min(first + 5, len(lights))),
        )
        add_light(parts, receivers, part, seen, np.inf)
    np.testing.assert_allclose(parts - 7.0, 2.0 * (whole - 7.0), rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(whole[1:] - 7.0, (whole[0] - 7.0) * [[2.0], [3.0]], rtol=1e-4, atol=1e-5)


def test_nothing_to_light_and_nothing_to_light_with() -> None:
    of = cube(WHITE)
    polygons = Polygons.of(of.surfaces)
    none = Receivers.on(polygons, np.empty((0, 3)), np.empty(0, dtype=np.int32))
    assert lit(polygons, of, lamps(np.array([[0.5, 0.5, 0.0]]), UP), none).shape == (3, 0)
    some = Receivers.on(polygons, *spread(of, 10))
    assert not lit(polygons, of, lamps(np.empty((0, 3)), UP), some).any()


# --- closed forms ---


@given(st.integers(0, 1000), st.sampled_from([1.0, 1.5, 3.0, 7.0, 40.0]))
@settings(max_examples=20)
def test_lobes_shine_by_a_power_of_the_cosine(seed: int, lobe: float) -> None:
    """(k + 1) / (2 pi) cos^k cos' / r^2 of each watt."""
    of = room(square("floor", WHITE, z=0.0, low=-1.0, high=2.0))
    random = np.random.default_rng(seed)
    at, normal = np.array([0.5, 0.5, random.uniform(0.05, 1.0)]), random.normal(size=3) + 3.0 * DOWN
    normal /= np.linalg.norm(normal)
    points = np.column_stack([random.uniform(-1.0, 2.0, (200, 2)), np.zeros(200)])
    found = gains(of, lamps(at[None], normal, 3.0, lobe), points, np.zeros(200, dtype=np.int32))[0]
    apart = points - at
    far = np.linalg.norm(apart, axis=1)
    cosine = np.maximum(apart @ normal / far, 0.0)
    expected = 3.0 * (lobe + 1.0) / (2.0 * np.pi) * cosine**lobe * (cosine > 0.0) * (at[2] / far) / far**2
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6 * expected.max())


@pytest.mark.parametrize("bound", [0.03, 0.3, 3.0])
def test_the_product_of_cosines_over_the_squared_distance_is_bounded(bound: float) -> None:
    of = cube(WHITE)
    positions, patch = spread(of, 2000)
    light = lamps(np.array([[0.3, 0.4, 0.0]]), UP)
    free = gains(of, light, positions, patch)[0]
    bounded = gains(of, light, positions, patch, bound=bound)[0]
    most = bound / np.pi / of.surfaces.size**2
    assert free.max() > most
    np.testing.assert_allclose(bounded, np.minimum(free, most), rtol=1e-6)


def test_a_lamp_s_lights_add_up_to_its_form_factor() -> None:
    """A square of side 1 seen from 2 below its middle: four times the corner of one of side 1 / 2."""
    lamp = square("lamp", material(0.0, 5.0), z=2.0, down=True, low=-0.5, high=0.5)
    of = room(lamp, square("floor", material(0.0), z=0.0, low=-1.0))
    floor = patch_at(of, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    found = gains(of, of.block(4096), np.zeros((1, 3)), np.array([floor], dtype=np.int32), 8)
    slant = 0.25 / np.sqrt(1.0 + 0.25**2)
    assert found.sum() == pytest.approx(5.0 * 4.0 / np.pi * slant * np.arctan(slant), rel=1e-3)


# --- any size, anywhere ---


def scaled(name: str, scale: float, shift: FloatArray) -> Room:
    scene = load_sample(name)
    objects = (
        SceneObject(o.id, Mesh(scale * o.world_vertices + shift, o.mesh.faces), o.material) for o in scene
    )
    return room(*objects)


@pytest.mark.parametrize(("scale", "away"), [(1e-3, 0.0), (1e4, 0.0), (1.0, 1e4), (1e-3, 10.0)])
def test_size_and_place_of_a_scene_do_not_matter(scale: float, away: float) -> None:
    shift = away * np.array([1.0, -0.5, 2.0])
    here, there = room_of(load_sample("office")), scaled("office", scale, shift)
    lights, (positions, patch) = few(here, 16), spread(here, 1500)
    shone = gains(here, lights, positions, patch, 64)
    far = lamps(scale * lights.position + shift, lights.normal)
    far = VirtualLights(**{**vars(far), "power": lights.power, "lobe": lights.lobe})
    found = scale**2 * gains(there, far, scale * positions + shift, patch, 64)
    # What lies on the edge of a shadow, or on a ray along an edge of the scene, may be rounded otherwise.
    same = np.isclose(found, shone, rtol=1e-3, atol=1e-6 * shone.max())
    assert np.mean(~same) < 1e-3
    total = shone.sum(axis=0)
    assert np.sqrt(np.sum((found.sum(axis=0) - total) ** 2) / np.sum(total**2)) < 2e-3


def test_lights_are_told_in_local_units() -> None:
    of = scaled("cornell", 100.0, np.array([5.0, 0.0, 0.0]))
    shining = ShiningLights.of(
        Polygons.of(of.surfaces), of.surfaces.center[None], UP[None], np.full((1, 3), 2.0), np.ones(1)
    )
    np.testing.assert_allclose(shining.frames[:3, 0], 0.0, atol=1e-7)
    np.testing.assert_allclose(shining.power, 2.0 / np.pi / of.surfaces.size**2, rtol=1e-6)
    assert len(shining) == 1
