"""Images of lights shine through their mirrors alone, with shadows on every part of the way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.geometry.scene import Mesh, SceneObject
from solver.illumination.particles.images import ShiningImages, look_through
from solver.illumination.particles.lighting import ShiningLights, add_light
from solver.illumination.particles.lights import VirtualLights
from solver.illumination.particles.mirror_ways import DIMMEST, follow
from solver.illumination.particles.mirrors import Images, mirror_images
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.sights import look_around
from solver.types import Float32Array, FloatArray, IntArray, Points
from tests.illumination.particles.rooms import CUBE, GREY, INWARD, LAMP, Room, material, polygon, room, square
from tests.illumination.particles.twin import irradiance_of

MIRROR = material(0.1, specular=(0.8, 0.7, 0.6))
TWO_SIDED = material(0.3, two_sided=True)


def hall() -> Room:
    """A glossy floor, a mirror for a wall, a screen with mirrors on both sides, and what shadows fall from.

    A board sticks out of the mirror on both sides: what is behind the mirror must not count.
    """
    walls = [material(0.2, specular=0.6, exponent=8.0), LAMP, MIRROR, GREY, GREY, GREY]
    both = material(0.0, specular=0.9, two_sided=True)
    return room(
        *(SceneObject(f"face{k}", Mesh(CUBE, (INWARD[k],)), walls[k]) for k in range(6)),
        polygon("screen", [[0.2, 0.3, 0.1], [0.7, 0.3, 0.1], [0.7, 0.35, 0.8], [0.2, 0.35, 0.8]], both),
        polygon("block", [[0.3, 0.6, 0], [0.5, 0.6, 0], [0.5, 0.7, 0.5], [0.3, 0.7, 0.5]], TWO_SIDED),
        polygon("board", [[-0.1, 0.8, 0.3], [0.3, 0.8, 0.3], [0.3, 0.8, 0.5], [-0.1, 0.8, 0.5]], TWO_SIDED),
    )


def points_of(of: Room, count: int, seed: int = 0) -> tuple[Points, IntArray]:
    """Points on all patches, parallelograms in these scenes, by area."""
    random, s = np.random.default_rng(seed), of.surfaces
    patch = np.sort(random.choice(s.patch_count, count, p=s.area / s.area.sum()))
    u, v = random.random((2, count, 1))
    c = s.corners[patch]
    return c[:, 0] + u * (c[:, 1] - c[:, 0]) + v * (c[:, 3] - c[:, 0]), patch.astype(np.int32)


def light_at(
    of: Room, lights: VirtualLights, images: Images | None, points: Points, patch: IntArray, size: int = 128
) -> FloatArray:
    """Irradiance (n, 3) by lights, or by their images alone."""
    polygons = Polygons.of(of.surfaces)
    receivers = Receivers.on(polygons, points, patch)
    found: Float32Array = np.zeros((3, len(patch)), dtype=np.float32)
    shining = ShiningLights.all_of(polygons, lights)
    sights = look_around(of.rays, polygons, shining.frames, size)
    if images is None:
        add_light(found, receivers, shining, sights, math.inf)
    else:
        folded = look_through(of.rays, polygons, shining, sights, ShiningImages.of(polygons, shining, images))
        add_light(found, receivers, folded.lights, folded.sights, math.inf, folded.folds)
    return np.asarray(found.T, dtype=np.float64)


@pytest.mark.parametrize("mirrored", [False, True])
def test_maps_agree_with_a_ray_for_each_part_of_the_way(mirrored: bool) -> None:
    """Glossy lights and their images among them; what errs is within a texel of a shadow's corner."""
    of = hall()
    lights = of.block(24)
    assert np.any(lights.gloss >= 0.0)
    images = mirror_images(lights, of.surfaces, deepest=1, slightest=0.0) if mirrored else None
    points, patch = points_of(of, 2000)
    found = light_at(of, lights, images, points, patch)
    one_by_one = images.lights if images is not None else lights
    expected = irradiance_of(one_by_one, points, of.surfaces.normal[patch], of)
    off = np.abs(found - expected).max(axis=1) > 1e-3 * expected.max(axis=1) + 1e-4 * expected.mean()
    assert off.mean() < 0.01
    np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), rtol=1e-3)


def square_factor(half: float, distance: float) -> float:
    """Form factor from a point to a square of half side `half` that faces it on its axis."""
    a = half / distance
    b = math.sqrt(1.0 + a * a)
    return 4.0 / math.pi * (a / b) * math.atan(a / b)


def periscope(first: float, second: float) -> Room:
    """A lamp at the origin that is seen from (1, 0, 2) by two mirrors at half a right angle alone."""

    def turned(name: str, x: float, z: float, up: float, rho: float) -> SceneObject:
        corners = np.array([[0.3, -0.3, 0.3], [-0.3, -0.3, -0.3], [-0.3, 0.3, -0.3], [0.3, 0.3, 0.3]])
        way = corners if up < 0 else corners[::-1]
        return polygon(name, np.add(way, [x, 0.0, z]), material(0.0, specular=rho))

    black = material(0.0, two_sided=True)
    return room(
        square("lamp", material(0.0, 1.0), 0.0, low=-0.1, high=0.1),
        turned("first", 0.0, 1.0, -1.0, first),
        turned("second", 1.0, 1.0, 1.0, second),
        polygon("plate", [[-2, -2, 1.5], [0.85, -2, 1.5], [0.85, 2, 1.5], [-2, 2, 1.5]], black),
        polygon("eye", [[0.9, 0.1, 2], [1.1, 0.1, 2], [1.1, -0.1, 2], [0.9, -0.1, 2]], GREY),
    )


def test_a_periscope_passes_on_the_light_of_an_image_of_an_image() -> None:
    of = periscope(0.9, 0.5)
    lights = of.block(256)
    eye = np.flatnonzero(of.surfaces.center[2] < of.surfaces.corners[:, 0, 2])[-1:].astype(np.int32)
    lights = lights.take(np.flatnonzero(lights.generation == 0))
    images = mirror_images(lights, of.surfaces, slightest=0.0)
    assert set(images.parent.tolist()) != {-1}
    point = np.array([[1.0, 0.0, 2.0]])
    assert np.all(light_at(of, lights, None, point, eye) == 0.0)
    expected = 0.9 * 0.5 * square_factor(0.1, 3.0)
    np.testing.assert_allclose(light_at(of, lights, images, point, eye), expected, rtol=1e-5)


def test_mirrors_pass_on_what_falls_on_them_and_no_more() -> None:
    """In a closed room all of it arrives somewhere: the flux by images is that on the mirror times rho_s."""
    walls = [MIRROR, *[GREY] * 5]
    of = room(
        *(SceneObject(f"face{k}", Mesh(CUBE, (INWARD[k],)), walls[k]) for k in range(6)),
        square("lamp", material(0.0, 1.0), 0.9, down=True, low=0.3, high=0.6),
        polygon("screen", [[0.2, 0.7, 0.3], [0.8, 0.7, 0.3], [0.8, 0.7, 0.6], [0.2, 0.7, 0.6]], TWO_SIDED),
    )
    lights = of.block(64)
    lights = lights.take(np.flatnonzero(lights.generation == 0))
    images = mirror_images(lights, of.surfaces, deepest=1, slightest=0.0)
    points, patch = points_of(of, 60_000)
    area = of.surfaces.area.sum() / len(patch)
    fallen = area * light_at(of, lights, None, points, patch)[patch == 0].sum(axis=0)
    passed = area * light_at(of, lights, images, points, patch).sum(axis=0)
    np.testing.assert_allclose(passed, [0.8, 0.7, 0.6] * fallen, rtol=0.02)


def test_few_images_of_images_stand_for_all_in_the_mean() -> None:
    of = hall()
    lights = of.block(4)
    way = np.array([0.3, -0.5, 0.8])

    def at_depths(images: Images) -> FloatArray:
        deep = images.parent >= 0
        weight = images.lights.power[:, 0] * np.exp(images.lights.position @ way)
        return np.array([weight[~deep].sum(), weight[deep].sum()])

    every = mirror_images(lights, of.surfaces, deepest=2, slightest=0.0)
    for most, slightest in ((len(lights), 0.0), (None, 2.0)):
        few = [mirror_images(lights, of.surfaces, most, seed, 2, slightest) for seed in range(400)]
        counts = [len(images.parent) for images in few]
        assert np.mean(counts) < 0.8 * len(every.parent)
        found = np.array([at_depths(images) for images in few])
        error = found.std(axis=0, ddof=1) / math.sqrt(len(few))
        np.testing.assert_array_less(np.abs(found.mean(axis=0) - at_depths(every)), 4.0 * error)


def test_images_come_after_what_they_show() -> None:
    of = hall()
    lights = of.block(8)
    images = mirror_images(lights, of.surfaces)
    deep = np.flatnonzero(images.parent >= 0)
    assert len(deep) > 0 and np.all(images.parent < np.arange(len(images.parent)))
    np.testing.assert_array_equal(images.source[deep], images.source[images.parent[deep]])
    assert np.all(images.lights.mirror[deep] != images.lights.mirror[images.parent[deep]])


# --- rays that go on at mirrors ---


def facing_mirrors(rho: float) -> Room:
    """Mirrors 1 m apart, the upper one with a little emission."""
    return room(
        square("lower", material(0.0, specular=rho), 0.0, low=-10.0, high=10.0),
        square("upper", material(0.0, 1.0, specular=rho), 1.0, down=True, low=-10.0, high=10.0),
    )


def test_rays_between_mirrors_go_on_until_they_are_dim() -> None:
    of = facing_mirrors(0.5)
    slant = np.array([[0.6, 0.0, 0.8]])
    ends = follow(of.surfaces, of.rays, np.array([[0.0, 0.0, 0.5]]), slant)
    k = np.arange(len(ends.row))
    np.testing.assert_array_equal(ends.depth, 2 * k)
    np.testing.assert_allclose(ends.weight[:, 0], 0.25**k)
    np.testing.assert_allclose(ends.distance, (0.5 + 2.0 * k) / 0.8, rtol=1e-4)
    np.testing.assert_allclose(ends.along, np.repeat(slant, len(k), axis=0), atol=1e-12)
    assert 0.25 * ends.weight[-1, 0] < DIMMEST <= ends.weight[-1, 0]


def test_rays_end_where_they_reach_no_farther() -> None:
    of = facing_mirrors(0.9)
    ends = follow(of.surfaces, of.rays, np.array([[0.0, 0.0, 0.5]]), np.array([[0.0, 0.0, 1.0]]), 4.0)
    np.testing.assert_array_equal(ends.depth, [0, 2])


def test_backs_of_mirrors_are_black() -> None:
    of = facing_mirrors(0.9)
    outside = follow(of.surfaces, of.rays, np.array([[0.0, 0.0, 2.0]]), np.array([[0.0, 0.0, -1.0]]))
    assert len(outside.row) == 0
