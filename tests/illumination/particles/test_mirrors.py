"""Specular surfaces: paths go on at them, and planar mirrors show each light a second time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.illumination.particles.lights import VirtualLights, join
from solver.illumination.particles.mirrors import mirrored_lights, mirrors_of
from solver.illumination.particles.walk import WalkSettings
from solver.pathtracing import PathTracer
from solver.types import FloatArray, Points
from tests.illumination.particles.rooms import (
    CUBE,
    INWARD,
    Room,
    cube,
    material,
    polygon,
    room,
    scatter,
    square,
)
from tests.illumination.particles.twin import irradiance_of
from tests.pathtracing.agreement import assert_agrees

EITHER = [WalkSettings(), WalkSettings(absorb_at_random=True)]


def both(lights: VirtualLights, of: Room) -> VirtualLights:
    """Lights with their images."""
    return join([lights, mirrored_lights(lights, of.surfaces)], lights.paths)


def mean_irradiance(
    of: Room, points: Points, normals: FloatArray, count: int, seeds: int, settings: WalkSettings
) -> tuple[FloatArray, FloatArray]:
    """Irradiance (n,) by lights and images over blocks, and its standard error."""
    return scatter(
        [
            irradiance_of(both(of.block(count, seed, settings=settings), of), points, normals, of)[:, 0]
            for seed in range(seeds)
        ]
    )


# --- images ---


def test_an_image_is_behind_its_mirror() -> None:
    mirror = material(specular=(0.9, 0.8, 0.7))
    of = room(
        square("lamp", material(0.0, 1.0), z=1.0, down=True),
        polygon("mirror", [[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]], mirror),
    )
    lights = of.block(16)
    images = mirrored_lights(lights, of.surfaces)
    assert mirrors_of(of.surfaces).tolist() == [1]
    np.testing.assert_allclose(images.position, lights.position * [-1.0, 1.0, 1.0])
    np.testing.assert_allclose(images.power, lights.power * [0.9, 0.8, 0.7])
    np.testing.assert_allclose(images.normal, lights.normal)
    assert np.all(images.mirror == 1) and images.paths == 16
    np.testing.assert_array_equal(images.path, lights.path)
    with pytest.raises(ValueError, match="no images"):
        mirrored_lights(images, of.surfaces)


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda n: np.linalg.norm(n) > 0.1))
def test_mirroring_keeps_distances_to_the_mirror_and_angles(way: list[float]) -> None:
    """The image in any plane: as far behind as the light is before, of equal angle to the plane."""
    normal = np.array(way) / np.linalg.norm(way)
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    anchor = np.array([3.0, -2.0, 5.0])
    corners = anchor + np.array([-first - second, first - second, first + second, second - first])
    lamp = anchor + normal + 0.1 * np.array([second - first, first, -second])
    of = room(
        polygon("mirror", corners, material(specular=0.5)), polygon("lamp", lamp[::-1], material(0.0, 1.0))
    )
    lights = of.block(8)
    images = mirrored_lights(lights, of.surfaces)
    if not len(images):
        assert lights.normal[0] @ normal > 0.0
        return
    before, behind = (lights.position - anchor) @ normal, (images.position - anchor) @ normal
    np.testing.assert_allclose(behind, -before, atol=1e-12)
    np.testing.assert_allclose((images.position + lights.position) / 2.0 @ normal, anchor @ normal)
    np.testing.assert_allclose(np.cross(images.position - lights.position, normal), 0.0, atol=1e-12)
    np.testing.assert_allclose(images.normal @ normal, -lights.normal @ normal, atol=1e-12)


def test_only_mirrors_that_face_each_other_with_a_light_show_it() -> None:
    lamp = square("lamp", material(0.0, 1.0), z=0.0)
    shiny = material(specular=0.9)
    of = room(
        lamp,
        square("facing", shiny, z=1.0, down=True),
        square("turned away", shiny, z=2.0),
        square("behind", shiny, z=-1.0),
        square("glossy", material(specular=0.9, exponent=20.0), z=3.0, down=True),
        square("two sides", material(specular=0.9, two_sided=True), z=4.0),
    )
    images = mirrored_lights(of.block(4).take(np.arange(4)), of.surfaces)
    names = {of.surfaces.object_ids[of.surfaces.object[patch]] for patch in images.mirror}
    assert names == {"facing", "two sides"} and len(images) == 8


def test_without_mirrors_or_lights_there_are_no_images() -> None:
    dark, plain = cube(material(0.5, specular=0.3)), cube(material(0.5, 1.0))
    assert len(mirrored_lights(dark.block(8), dark.surfaces)) == 0
    assert len(mirrored_lights(plain.block(8), plain.surfaces, most=3)) == 0


# --- what is seen by way of mirrors ---


def test_a_mirror_floor_is_a_second_lamp() -> None:
    """A wall is lit by the lamp and by its image under the floor, as far as the floor shows it."""
    lamp = square("lamp", material(0.0, 1.0), z=1.0, down=True, low=-0.2, high=0.2)
    positions = np.array([[3.0, 0.0, 0.5], [3.0, 1.0, 1.0], [9.0, 0.0, 0.5]])
    normals = np.tile([-1.0, 0.0, 0.0], (3, 1))
    image = square("image", material(0.0, 0.8), z=-1.0, low=-0.2, high=0.2)
    wide = room(lamp, square("floor", material(specular=0.8), z=0.0, low=-20.0, high=20.0))
    alone = room(lamp, square("far", material(), z=-9.0, low=-20.0, high=20.0))
    below = room(image, square("far", material(), z=-9.0, low=-20.0, high=20.0))
    direct, mirrored = (irradiance_of(of.block(2048), positions, normals, of)[:, 0] for of in (alone, below))
    found = irradiance_of(both(wide.block(2048), wide), positions, normals, wide)[:, 0]
    np.testing.assert_allclose(found, direct + mirrored, rtol=2e-3)

    # A small one shows the image to none of them but the first.
    small = polygon("floor", [[1.7, -1, 0], [2.3, -1, 0], [2.3, 1, 0], [1.7, 1, 0]], material(specular=0.8))
    narrow = room(lamp, small)
    found = irradiance_of(both(narrow.block(2048), narrow), positions, normals, narrow)[:, 0]
    np.testing.assert_allclose(found[0], direct[0] + mirrored[0], rtol=2e-3)
    np.testing.assert_allclose(found[2], direct[2], rtol=2e-3)


@pytest.mark.parametrize("settings", EITHER, ids=["shared", "absorbed"])
def test_a_furnace_with_a_perfect_mirror(settings: WalkSettings) -> None:
    """Half of a furnace and a mirror for the other half: irradiance is 1 / (1 - rho) everywhere."""
    paint = material(0.6, 1.0)
    of = cube(paint, paint, paint, paint, paint, material(specular=1.0))
    positions = np.array([[0.5, 0.5, 0.0], [0.0, 0.4, 0.6], [0.5, 0.0, 0.5], [0.5, 0.6, 0.5]])
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.6, 0.8]])
    mean, error = mean_irradiance(of, positions, normals, 128, 40, settings)
    assert_agrees(mean, error, 2.5, passes=40)
    assert (error / mean).max() < 0.02


@pytest.mark.parametrize("settings", EITHER, ids=["shared", "absorbed"])
def test_a_furnace_with_a_mirror_that_absorbs_and_shines(settings: WalkSettings) -> None:
    """The mirror, of rho_s = 0.7 and rho_d = 0.1, emits what it absorbs of 1 / (1 - rho)."""
    paint, level = material(0.5, 1.0), 2.0
    of = cube(paint, paint, paint, paint, paint, material(0.1, 0.2 * level, specular=0.7))
    positions = np.array([[0.5, 0.5, 0.0], [0.0, 0.4, 0.6], [0.5, 0.6, 0.5]])
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.6, 0.8]])
    mean, error = mean_irradiance(of, positions, normals, 128, 40, settings)
    assert_agrees(mean, error, level, passes=40)
    assert (error / mean).max() < 0.03


def test_a_mirrored_half_is_as_the_whole() -> None:
    """A lit room with a mirror for a wall, and the room twice as long: the same light, paths and images."""
    wall, lamp = material((0.7, 0.5, 0.3)), material(0.0, (5.0, 4.0, 3.0))
    half = CUBE * [1.0, 1.0, 1.0]
    whole = CUBE * [1.0, 2.0, 1.0]
    faces = {"floor": (0, 1, 3, 2), "ceiling": (4, 6, 7, 5), "left": (0, 2, 6, 4), "right": (1, 5, 7, 3)}
    ends = {"near": (0, 4, 5, 1), "far": (2, 3, 7, 6)}

    def lit(*at: float) -> list[FloatArray]:
        return [
            np.array([[0.4, y - 0.1, 0.8], [0.4, y + 0.1, 0.8], [0.6, y + 0.1, 0.8], [0.6, y - 0.1, 0.8]])
            for y in at
        ]

    def built(corners: FloatArray, lamps: list[FloatArray], far: bool) -> Room:
        sides = {**faces, **(ends if far else {"near": ends["near"]})}
        return room(
            *(polygon(name, corners[list(face)], wall) for name, face in sides.items()),
            *(polygon(f"lamp{k}", found, lamp) for k, found in enumerate(lamps)),
            *([] if far else [polygon("mirror", corners[list(ends["far"])], material(specular=1.0))]),
        )

    mirrored, doubled = built(half, lit(0.3), False), built(whole, lit(0.3, 1.7), True)
    positions = np.array([[0.5, 0.8, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.4]])
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    found = [
        irradiance_of(both(mirrored.block(256, s), mirrored), positions, normals, mirrored) for s in range(24)
    ]
    truth = [irradiance_of(doubled.block(512, s), positions, normals, doubled) for s in range(24)]
    mean, error = scatter(found)
    expected, noise = scatter(truth)
    assert_agrees(mean, error, expected, noise, passes=24)
    assert (error / mean).max() < 0.03


def test_all_that_is_not_diffuse_agrees_with_the_path_tracer() -> None:
    """A directional lamp, a coloured mirror and a glossy floor: paths, images and glossy lights together."""
    wall = material((0.6, 0.5, 0.4))
    lamp = material(0.0, (5.0, 4.0, 3.0), emission_exponent=3.0)
    of = room(
        *(polygon(f"wall{k}", CUBE[list(INWARD[k])], wall) for k in (1, 2, 4, 5)),
        polygon("floor", CUBE[list(INWARD[0])], material(0.3, specular=(0.5, 0.4, 0.3), exponent=12.0)),
        polygon("mirror", CUBE[list(INWARD[3])], material(0.1, specular=(0.8, 0.7, 0.5))),
        polygon("lamp", [[0.3, 0.4, 0.9], [0.3, 0.6, 0.9], [0.5, 0.6, 0.9], [0.5, 0.4, 0.9]], lamp),
    )
    positions = np.array([[0.0, 0.5, 0.5], [0.4, 0.0, 0.5], [0.4, 0.5, 0.45], [0.5, 0.5, 1.0]])
    normals = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.0, -0.8], [0.0, 0.0, -1.0]])
    found = [irradiance_of(both(of.block(256, seed), of), positions, normals, of) for seed in range(60)]
    mean, error = scatter(found)
    truth, noise = PathTracer(of.surfaces, of.rays, 1).irradiance(positions, normals, 1 << 15)
    assert_agrees(mean, error, truth, noise, passes=60)
    assert (error / mean).max() < 0.02


def test_few_of_many_images_are_right_in_the_mean() -> None:
    paint = material(0.5, 1.0)
    tiles = [
        polygon(f"tile{j}{k}", CUBE[[4, 6, 7, 5]] * 0.25 + [0.25 * j, 0.25 * k, 0.75], material(specular=0.9))
        for j in range(4)
        for k in range(4)
    ]
    of = room(*tiles, square("floor", paint, z=0.0), square("side", paint, z=0.2, low=1.2, high=1.6))
    lights = of.block(48)
    positions, normals = np.array([[0.5, 0.5, 0.3], [0.2, 0.9, 0.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    every = mirrored_lights(lights, of.surfaces)
    expected = irradiance_of(every, positions, normals, of)[:, 0]
    assert len(every) > 500
    few = [mirrored_lights(lights, of.surfaces, 100, seed) for seed in range(300)]
    assert {len(images) for images in few} <= {99, 100, 101}
    mean, error = scatter([irradiance_of(images, positions, normals, of)[:, 0] for images in few])
    assert_agrees(mean, error, expected, passes=len(few))
    assert (error / mean).max() < 0.05
    all_of_them = mirrored_lights(lights, of.surfaces, most=len(every))
    np.testing.assert_array_equal(all_of_them.power, every.power)


# --- paths that go on ---


@pytest.mark.parametrize("settings", EITHER, ids=["shared", "absorbed"])
@pytest.mark.parametrize(("diffuse", "specular"), [(0.4, 0.4), (0.1, 0.8), (0.5, 0.0)])
def test_generations_keep_their_energy(diffuse: float, specular: float, settings: WalkSettings) -> None:
    """In a closed box a generation has rho_d / (1 - rho_s) of the one before: mirrors only pass on."""
    of = cube(material(diffuse, 1.0, specular=specular))
    found = []
    for seed in range(200):
        lights = of.block(64, seed, settings=settings)
        found.append(np.bincount(lights.generation, lights.power[:, 0], 4)[:4].astype(float))
    mean, error = scatter(found)
    share = diffuse / (1.0 - specular)
    assert_agrees(mean, error, np.array([6.0 * share**j for j in range(4)]), passes=200)
    assert error.max() < 0.2


def test_mirrors_send_paths_on_within_their_generation() -> None:
    """A narrow lamp, a mirror at 45 degrees, a wall: the first generation is where the mirror sends it."""
    lamp = square("lamp", material(0.0, 1.0, emission_exponent=1e8), z=0.0, low=-0.1, high=0.1)
    mirror = polygon(
        "mirror", [[-1, -1, 0], [-1, 1, 0], [1, 1, 2], [1, -1, 2]], material(specular=(0.9, 0.6, 0.3))
    )
    wall = polygon("wall", [[5, -1, 0], [5, -1, 3], [5, 1, 3], [5, 1, 0]], material(0.5))
    of = room(lamp, mirror, wall)
    lights = of.block(64)
    first = lights.take(np.flatnonzero(lights.generation == 1))
    assert len(first) > 0 and np.all(first.position[:, 0] == 5.0)
    np.testing.assert_allclose(first.incident, np.tile([1.0, 0.0, 0.0], (len(first), 1)), atol=1e-3)
    np.testing.assert_allclose(first.power.sum(axis=0), 0.04 * 0.5 * np.array([0.9, 0.6, 0.3]))


@pytest.mark.parametrize("exponent", [1.0, 5.0, 50.0])
def test_glossy_surfaces_scatter_in_their_lobe(exponent: float) -> None:
    """Light straight down on a floor of gloss n leaves as cos^(n + 1), none of it lost but to the floor."""
    of = room(
        square("lamp", material(0.0, 1.0, emission_exponent=1e8), z=1.0, down=True, low=-0.001, high=0.001),
        square("floor", material(0.0, specular=0.8, exponent=exponent), z=0.0, low=-1.0, high=1.0),
        square("sky", material(0.5), z=2.0, down=True, low=-500.0, high=500.0),
    )
    power = 0.002**2
    lights = of.block(16384)
    glossy = lights.take(np.flatnonzero((lights.gloss >= 0.0) & (lights.generation == 1)))
    assert np.all(glossy.gloss == exponent) and np.all(glossy.lobe == 1.0)
    assert np.all(glossy.position[:, 2] == 0.0)
    np.testing.assert_allclose(glossy.power[:, 0].sum(), 0.8 * power)
    np.testing.assert_allclose(glossy.incident, np.tile([0.0, 0.0, -1.0], (len(glossy), 1)), atol=1e-3)

    sky = lights.take(np.flatnonzero((lights.generation == 1) & (lights.gloss < 0.0)))
    cosine, arrived = sky.incident[:, 2], sky.power[:, 0] / 0.5
    assert arrived.sum() == pytest.approx(0.8 * power, rel=0.01)
    for bound in (0.9, 0.7, 0.4):
        share = arrived[cosine > bound].sum() / (0.8 * power)
        assert share == pytest.approx(1.0 - bound ** (exponent + 2.0), abs=0.02)


def test_glossy_lights_shine_as_the_lobe_has_it() -> None:
    """A small lamp over a glossy floor: what a point gets by way of the floor, beside an integral over it."""
    n, rho, z = 8.0, 0.6, 0.7
    lamp = square("lamp", material(0.0, 1.0), z=z, down=True, low=-0.01, high=0.01)
    of = room(lamp, square("floor", material(0.0, specular=rho, exponent=n), z=0.0, low=-4.0, high=4.0))
    point, normal = np.array([1.0, 0.2, 0.8]), np.array([-0.6, 0.0, -0.8])
    found = []
    for seed in range(12):
        lights = of.block(1024, seed)
        glossy = lights.take(np.flatnonzero(lights.gloss >= 0.0))
        found.append(irradiance_of(glossy, point[None], normal[None], of)[0, :1])
    mean, error = scatter(found)

    x = (np.arange(1200) + 0.5) / 1200 * 8.0 - 4.0
    floor = np.stack([*np.meshgrid(x, x), np.zeros((1200, 1200))], axis=-1).reshape(-1, 3)
    coming = floor - [0.0, 0.0, z]
    squared = np.einsum("na,na->n", coming, coming)
    coming /= np.sqrt(squared)[:, None]
    lit = 0.02**2 / math.pi * coming[:, 2] ** 2 / squared
    out = point - floor
    distance = np.linalg.norm(out, axis=1)
    out /= distance[:, None]
    alpha = np.maximum(np.einsum("na,na->n", out, coming * [1.0, 1.0, -1.0]), 0.0)
    radiance = rho * (n + 2.0) / (2.0 * math.pi) * alpha**n * lit
    cosines = out[:, 2] * np.maximum(-out @ normal, 0.0)
    expected = float(np.sum(radiance * cosines / distance**2)) * (8.0 / 1200) ** 2
    assert_agrees(mean, error, expected, 1e-4 * expected, passes=12)
    assert error[0] < 0.02 * expected


def test_paths_among_mirrors_end() -> None:
    """Nearly all is reflected, hardly any of it diffusely: pieces are many, and light is what there is."""
    of = cube(material(0.02, 1.0, specular=0.97))
    found = []
    for seed in range(60):
        lights = of.block(64, seed, settings=WalkSettings())
        found.append(np.bincount(lights.generation, lights.power[:, 0], 2)[1:2].astype(float))
    mean, error = scatter(found)
    assert_agrees(mean, error, 6.0 * 0.02 / 0.03, passes=60)


@given(st.floats(0.0, 0.9), st.floats(0.0, 0.09), st.sampled_from([0.0, 1.0, 10.0, 1e5, math.inf]))
def test_light_never_exceeds_what_came_in(specular: float, diffuse: float, exponent: float) -> None:
    """Whatever the materials: what arrives at black walls all together is at most what was emitted."""
    shiny = material(diffuse, specular=specular, exponent=exponent)
    of = cube(shiny, material(0.05, 1.0), shiny, shiny, material(0.05), shiny)
    lights = [of.block(64, seed) for seed in range(4)]
    s = of.surfaces
    absorbed = 0.0
    for block in lights:
        again = block.take(np.flatnonzero((block.generation > 0) & np.isin(block.patch, [1, 4])))
        absorbed += float((again.power[:, 0] / s.reflectance[again.patch, 0] * 0.95).sum()) / 4.0
    assert absorbed < 1.0 + 0.25
