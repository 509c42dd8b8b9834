"""Walks: how many lights there are and where, and what they depend on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.illumination.particles.lights import VirtualLights, join, join_blocks
from solver.illumination.particles.path_numbers import PathNumbers, PathPoints
from solver.illumination.particles.walk import ParticleWalk, WalkSettings, mean_reflectivity
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Int64Array
from tests.illumination.particles.rooms import (
    CEILING_LIGHT,
    GREY,
    LAMP,
    UNBIASED,
    cube,
    label,
    material,
    room,
    room_of,
    scatter,
    square,
)

EVERY = [
    *UNBIASED,
    WalkSettings(PathPoints.JITTERED),
    WalkSettings(PathPoints.JITTERED, absorb_at_random=True),
]


def arrays(lights: VirtualLights) -> list[FloatArray]:
    return [lights.position, lights.normal, lights.power, lights.incident, lights.lobe, lights.gloss]


def assert_same(a: VirtualLights, b: VirtualLights) -> None:
    for first, second in zip(arrays(a), arrays(b), strict=True):
        np.testing.assert_array_equal(first, second)


# --- how many, and where ---


def test_generations_are_the_first_paths() -> None:
    """[K 3.2] Of 100 paths in a closed room of reflectance 1/2, the first 50, 25, 12, 6, 3 and 1 go on."""
    lights = CEILING_LIGHT.block(100, first=7)
    for generation, count in enumerate([100, 50, 25, 12, 6, 3, 1]):
        found = lights.path[lights.generation == generation]
        assert found.tolist() == list(range(7, 7 + count))
    assert lights.paths == 100


def test_lights_of_a_generation_share_its_power() -> None:
    """Reflectance is that of the mean everywhere: N / floor(rho^j N) rho^j / N is what is left for each."""
    lights = CEILING_LIGHT.block(100)
    count = np.bincount(lights.generation)
    expected = 0.5**lights.generation / count[lights.generation]
    before_tail = lights.generation <= 6
    np.testing.assert_allclose(lights.power[before_tail], expected[before_tail, None] * [1.0, 1.0, 1.0])
    # In the tail, what is left of the chance to be absorbed is that of a light in the mean.
    np.testing.assert_allclose(lights.power[~before_tail], 1.0 / 100.0)


def test_jitter_has_the_range_of_each_generation(monkeypatch: pytest.MonkeyPatch) -> None:
    """[K 4.1] 1 / N on emitters, 1 / ceil(rho N) for the first directions, and so on; 2 dimensions each."""
    asked: list[tuple[int, float]] = []
    pairs = PathNumbers.pairs

    def listened(
        numbers: PathNumbers, first: int, rows: Int64Array, dimension: int, spread: float
    ) -> FloatArray:
        asked.append((dimension, 1.0 / spread))
        return pairs(numbers, first, rows, dimension, spread)

    monkeypatch.setattr(PathNumbers, "pairs", listened)
    cube(material(0.6, 1.0)).block(10, settings=WalkSettings(PathPoints.JITTERED))
    expected = [(2 * k, n) for k, n in enumerate([10, 6, 4, 3, 2, 1])]
    np.testing.assert_allclose(asked[:6], expected)


@given(st.floats(0.0, 0.95), st.integers(1, 200), st.integers(0, 5))
def test_lights_are_fewer_than_the_bound(reflectance: float, count: int, seed: int) -> None:
    """[K 3.2] M < N / (1 - rho), apart from the tail."""
    of = cube(material(reflectance, 1.0))
    lights = of.block(count, seed)
    whole = reflectance ** np.arange(300) * count >= 1.0
    assert np.sum(lights.generation < np.sum(whole)) <= count / (1.0 - reflectance) + 1e-9


@pytest.mark.parametrize("settings", EVERY, ids=label)
@pytest.mark.parametrize("count", [4, 32])
def test_mean_path_length(settings: WalkSettings, count: int) -> None:
    """[K 3.2] With the tail, less than 1 / (1 - rho) lights a path in the mean; so many without rounding."""
    of = cube(material(0.6, 1.0))
    lengths = np.array([[len(of.block(count, seed, settings=settings)) / count] for seed in range(400)])
    mean, error = scatter(list(lengths))
    if settings.absorb_at_random:
        assert abs(mean[0] - 2.5) < 4.0 * error[0]
    else:
        assert 2.5 - 8.0 / count < mean[0] < 2.5


def test_mean_reflectivity_is_by_area_and_luminance() -> None:
    s = room(
        square("a", material((0.8, 0.4, 0.2)), z=0.0, high=2.0),
        square("b", material(0.1, two_sided=True), z=1.0),
    ).surfaces
    bright = np.array([0.8, 0.4, 0.2]) @ LUMINANCE_WEIGHTS
    assert mean_reflectivity(s) == pytest.approx((4.0 * bright + 2.0 * 0.1) / 6.0)
    assert mean_reflectivity(room().surfaces) == 0.0


def test_mean_reflectivity_counts_what_mirrors_pass_on() -> None:
    """0.3 of light are reflected diffusely at once, and of the 0.4 that are not the same again, and so on."""
    s = room(
        square("a", material(0.5, specular=0.1), z=0.0), square("b", material(0.1, specular=0.7), z=1.0)
    ).surfaces
    assert mean_reflectivity(s) == pytest.approx(0.3 / 0.6)
    assert mean_reflectivity(room(square("a", material(specular=0.9), z=0.0)).surfaces) == 0.0
    glossy = room(square("a", material(specular=0.9, exponent=9.0), z=0.0)).surfaces
    assert mean_reflectivity(glossy) == pytest.approx(0.9)


@pytest.mark.parametrize("settings", EVERY, ids=label)
def test_lights_are_on_their_patches(settings: WalkSettings) -> None:
    """On the plane, within the corners, before who came; and they look away from their surface."""
    of = room_of(load_sample("cornell"))
    lights, s = of.block(300, settings=settings), of.surfaces
    corners, normal = s.corners[lights.patch], s.normal[lights.patch]
    height = np.einsum("ma,ma->m", lights.position - corners[:, 0], normal)
    assert np.abs(height).max() < 1e-12 * s.size
    edges = np.roll(corners, -1, axis=1) - corners
    left = np.einsum("mna,ma->mn", np.cross(edges, lights.position[:, None] - corners), normal)
    assert left.min() > -1e-5 * s.size**2
    np.testing.assert_array_equal(lights.normal, normal)
    again = lights.generation > 0
    assert np.all(np.einsum("ma,ma->m", lights.incident, normal)[again] < 0.0)
    np.testing.assert_allclose(np.linalg.norm(lights.incident[again], axis=1), 1.0)
    assert not lights.incident[~again].any()
    assert np.all(lights.mirror == -1) and np.all(lights.gloss == -1.0) and np.all(lights.lobe == 1.0)


def test_both_sides_of_a_screen_get_their_own() -> None:
    """Lamps below and above; the screen between them is lit on both sides, and so are its patches."""
    lamp = material(0.0, 1.0)
    of = room(
        square("below", lamp, z=0.0),
        square("above", lamp, z=1.0, down=True),
        square("screen", material(0.5, two_sided=True), z=0.5, low=-5.0, high=5.0),
    )
    lights = of.block(64)
    front, back = np.flatnonzero(of.surfaces.object == 2)
    on_front, on_back = lights.patch == front, lights.patch == back
    assert on_front.any() and on_back.any()
    assert np.all(lights.incident[on_front, 2] < 0.0) and np.all(lights.incident[on_back, 2] > 0.0)


def test_black_sides_and_the_open_end_paths() -> None:
    """A lamp over the black back of one square, and beside nothing."""
    of = room(square("lamp", LAMP, z=1.0, down=True), square("floor", GREY, z=0.0, down=True))
    lights = of.block(64)
    assert lights.generation.tolist() == [0] * 64
    assert len(room(square("lamp", LAMP, z=0.0)).block(64)) == 64


def test_without_light_there_are_no_lights() -> None:
    for of in (cube(GREY), room()):
        assert len(of.block(16)) == 0


# --- what depends on what ---


@pytest.mark.parametrize("settings", EVERY, ids=label)
def test_the_seed_decides(settings: WalkSettings) -> None:
    first, again, other = (CEILING_LIGHT.block(50, seed, settings=settings) for seed in (3, 3, 4))
    assert_same(first, again)
    assert not np.array_equal(first.position[:50], other.position[:50])


@pytest.mark.parametrize("points", list(PathPoints), ids=lambda points: points.value)
def test_paths_that_are_absorbed_at_random_are_their_own(points: PathPoints) -> None:
    """[K 4.3] One at a time they are what they are together, so that one can be replaced."""
    walk = ParticleWalk(CEILING_LIGHT.surfaces, CEILING_LIGHT.rays, WalkSettings(points, True, 5))
    whole = walk.block(20, 30)
    single = join([walk.block(20 + k, 1, among=30) for k in range(30)], 30)
    order = np.lexsort((whole.generation, whole.path))
    assert_same(whole.take(order), single)


@pytest.mark.parametrize(("first", "count", "among"), [(0, 0, None), (0, 5, 4), (-1, 4, None), (0, 4, 8)])
def test_blocks_that_are_none_are_refused(first: int, count: int, among: int | None) -> None:
    walk = ParticleWalk(CEILING_LIGHT.surfaces, CEILING_LIGHT.rays)
    with pytest.raises(ValueError, match=r"block|indices|absorbed"):
        walk.block(first, count, among)


def test_blocks_count_by_their_paths() -> None:
    blocks = [CEILING_LIGHT.block(count, first=first) for first, count in ((0, 32), (32, 32), (64, 64))]
    joined = join_blocks(blocks)
    assert joined.paths == 128 and len(joined) == sum(len(block) for block in blocks)
    emitted = joined.power[joined.generation == 0].sum(axis=0)
    np.testing.assert_allclose(emitted, 1.0)
    np.testing.assert_allclose(joined.power[: len(blocks[0])], 0.25 * blocks[0].power)
