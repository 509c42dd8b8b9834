"""Few lights for many paths: as many as wanted, alike in power, and right in the mean."""

from __future__ import annotations

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.geometry.scene import Material
from solver.illumination.particles.lighting import add_light
from solver.illumination.particles.lights import VirtualLights, join
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.sights import look_around
from solver.illumination.particles.thinning import MOST_LIGHTS, PATHS, thinned
from solver.types import LUMINANCE_WEIGHTS, FloatArray, IntArray, Points
from tests.illumination.particles.rooms import (
    CEILING_LIGHT,
    Room,
    cube,
    material,
    room,
    room_of,
    scatter,
    square,
)
from tests.illumination.particles.shining import shining_of, spread
from tests.illumination.particles.twin import irradiance_of
from tests.pathtracing.agreement import assert_agrees

SEEDS = 600


def colours(k: int) -> Material:
    """A material of its own for each wall of a cube; the ceiling emits."""
    red = 0.15 * k
    return material((0.8 - red, 0.3 + 0.1 * k % 0.5, red), (2.0, 1.0, 3.0) if k == 1 else 0.0)


COLOURED = cube(*(colours(k) for k in range(6)))


def luminous(lights: VirtualLights) -> FloatArray:
    return np.asarray(lights.power @ LUMINANCE_WEIGHTS)


def split(lights: VirtualLights) -> tuple[VirtualLights, VirtualLights]:
    """Those on emitters, and the reflected ones."""
    return (
        lights.take(np.flatnonzero(lights.generation == 0)),
        lights.take(np.flatnonzero(lights.generation > 0)),
    )


@pytest.mark.parametrize("paths", [1, 8, 32, 100])
def test_as_many_are_left_as_so_many_paths_would_leave(paths: int) -> None:
    """On emitters one for each path; reflected ones by what they carry together beside what is emitted."""
    walked = COLOURED.block(PATHS * paths)
    emitted, reflected = split(thinned(walked, COLOURED.surfaces, paths))
    assert emitted.path.tolist() == list(range(paths))
    every, before = split(walked)
    share = luminous(before).sum() / luminous(every).sum()
    assert len(reflected) == max(1, round(paths * share))


def test_blocks_further_on_keep_their_own_first_paths() -> None:
    lights = thinned(COLOURED.block(64 * 8, first=640), COLOURED.surfaces, 8)
    emitted, _ = split(lights)
    assert emitted.path.tolist() == list(range(640, 648))
    assert lights.paths == 8


def test_reflected_lights_are_equal_in_luminous_power() -> None:
    walked = COLOURED.block(64 * 32)
    emitted, reflected = split(thinned(walked, COLOURED.surfaces, 32))
    np.testing.assert_allclose(luminous(reflected), luminous(reflected)[0], rtol=1e-9)
    assert luminous(reflected)[0] == pytest.approx(luminous(emitted)[0], rel=0.1), "as on emitters"
    # Of either kind all luminous power is left.
    for after, before in ((emitted, split(walked)[0]), (reflected, split(walked)[1])):
        assert luminous(after).sum() == pytest.approx(luminous(before).sum(), rel=1e-9)


def test_colours_are_right_in_the_mean() -> None:
    walked = COLOURED.block(64 * 8)
    found = [thinned(walked, COLOURED.surfaces, 8, seed).power.sum(axis=0) for seed in range(SEEDS)]
    mean, error = scatter(found)
    assert_agrees(mean, error, walked.power.sum(axis=0), passes=SEEDS)
    assert np.all(error[[0, 2]] > 0.0)


@pytest.mark.parametrize("exponent", [4.0, 60.0, 1000.0])
def test_narrow_lobes_have_more_and_weaker_lights(exponent: float) -> None:
    """Weaker by the ratio of a lobe's root mean square to its mean; and no more than twice as many in all."""
    shiny = material(0.2, specular=(0.5, 0.4, 0.3), exponent=exponent)
    of = cube(material(0.6), material(0.5, (2.0, 1.0, 3.0)), shiny, *[material(0.6)] * 3)
    walked = of.block(PATHS * 32)
    _, reflected = split(thinned(walked, of.surfaces, 32))
    every, before = split(walked)
    weight = np.sqrt(1.0 + 0.5 * np.maximum(before.gloss, 0.0))
    more = float(luminous(before) @ weight / luminous(before).sum())
    plain = round(32 * luminous(before).sum() / luminous(every).sum())
    assert len(reflected) == pytest.approx(plain * min(more, 2.0), abs=1.0)
    np.testing.assert_allclose(
        luminous(reflected) * np.sqrt(1.0 + 0.5 * np.maximum(reflected.gloss, 0.0)),
        (luminous(before) @ weight) / len(reflected),
        rtol=1e-9,
    )
    found = [thinned(walked, of.surfaces, 32, seed).power.sum(axis=0) for seed in range(SEEDS)]
    assert_agrees(*scatter(found), walked.power.sum(axis=0), passes=SEEDS)


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_light_is_right_in_the_mean(name: str) -> None:
    """At points anywhere."""
    of = room_of(load_sample(name))
    positions, patch = spread(of, 60)
    walked = of.block(PATHS * 6)
    emitted, reflected = split(walked)
    first = emitted.take(np.arange(6)).scaled(PATHS)
    truth = bounded(of, join([first, reflected], 6), positions, patch)
    found = [
        bounded(of, thinned(walked, of.surfaces, 6, seed), positions, patch) - truth for seed in range(SEEDS)
    ]
    mean, error = scatter(found)
    lit = truth > 1e-3 * truth.max()
    assert lit.mean() > 0.9
    assert_agrees(mean[lit], error[lit], 0.0, 1e-6 * truth[lit], passes=SEEDS)
    whole, error_of_whole = scatter([one.mean(axis=1) for one in found])
    assert np.all(np.abs(whole) < 3.0 * error_of_whole)
    assert np.median(error[lit] / truth[lit]) < 0.02


def bounded(of: Room, lights: VirtualLights, positions: Points, patch: IntArray) -> FloatArray:
    """Irradiance (3, n), bounded, so that no single light near a point decides."""
    polygons = Polygons.of(of.surfaces)
    shining = shining_of(polygons, lights)
    light = np.zeros((3, len(patch)), dtype=np.float32)
    sights = look_around(of.rays, polygons, shining.frames, 12)
    add_light(light, Receivers.on(polygons, positions, patch), shining, sights, 10.0)
    return light.astype(np.float64)


def test_lights_are_spread_evenly_over_the_light_of_patches() -> None:
    """One is drawn from each stretch of equal power along a curve: no patch has many more or fewer."""
    walked = CEILING_LIGHT.block(64 * 64)
    before = split(walked)[1]
    for seed in range(10):
        after = split(thinned(walked, CEILING_LIGHT.surfaces, 64, seed))[1]
        share = np.bincount(before.patch, luminous(before), 6) / luminous(before).sum()
        count = np.bincount(after.patch, minlength=6)
        assert np.all(np.abs(count - share * len(after)) < 2.0)
        # And so in the quarters of each: along a Hilbert curve each of them is passed once.
        for p in np.unique(after.patch).tolist():
            s = CEILING_LIGHT.surfaces
            axes = [a for a in range(3) if abs(s.normal[p, a]) < 0.5]
            quarters = []
            for lights in (before, after):
                of_patch = lights.patch == p
                place = (lights.position[of_patch][:, axes] > 0.5) @ np.array([1, 2])
                quarters.append(np.bincount(place, luminous(lights)[of_patch], 4) / luminous(after)[0])
            assert np.all(np.abs(quarters[1] - quarters[0]) < 3.0)


def test_thinned_lights_differ_less_than_those_of_as_many_paths() -> None:
    """Irradiance of the walls' middles, over blocks of 16 paths."""
    middle, normals = COLOURED.surfaces.corners.mean(axis=1), COLOURED.surfaces.normal
    few, plain = [], []
    for number in range(40):
        walked = COLOURED.block(64 * 16, first=64 * 16 * number)
        few.append(irradiance_of(thinned(walked, COLOURED.surfaces, 16), middle, normals, COLOURED))
        plain.append(irradiance_of(COLOURED.block(16, first=16 * number), middle, normals, COLOURED))
    spread_few, spread_plain = (np.std(np.array(found), axis=0).mean() for found in (few, plain))
    assert spread_few < 0.75 * spread_plain


def test_what_is_few_already_stays() -> None:
    lights = COLOURED.block(8)
    assert thinned(lights, COLOURED.surfaces, 8) is lights
    assert thinned(lights, COLOURED.surfaces, 9) is lights


def test_nothing_reflected_and_nothing_emitted() -> None:
    black = room(square("lamp", material(0.0, 1.0), z=1.0, down=True), square("floor", material(0.0), z=0.0))
    lights = thinned(black.block(64), black.surfaces, 4)
    assert len(lights) == lights.paths == 4
    assert lights.power.sum() == pytest.approx(3.0)
    dark = cube(material(0.5))
    assert len(thinned(dark.block(64), dark.surfaces, 4)) == 0


def test_the_seed_decides() -> None:
    walked = COLOURED.block(64 * 8)
    a, b, c = (thinned(walked, COLOURED.surfaces, 8, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a.position, b.position)
    assert not np.array_equal(a.position, c.position)


def test_lights_of_white_rooms_are_bounded() -> None:
    """As many as 32 for each path, however often that is reflected; of the same power in all."""
    of = cube(*(material(0.99, 10.0 if k == 1 else 0.0) for k in range(6)))
    for more in (1, 4):
        walked = of.block(8 * more)
        emitted, reflected = split(thinned(walked, of.surfaces, 8))
        assert len(emitted.power) == 8 and len(reflected.power) == 8 * MOST_LIGHTS
        before, after = (
            split(lights)[1].power.sum(axis=0) for lights in (walked, thinned(walked, of.surfaces, 8))
        )
        np.testing.assert_allclose(after, before, rtol=1e-6)
