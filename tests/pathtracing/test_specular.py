"""Mirrors, furnaces with mirrors and gloss, balances of energy, and how the light of all of it is sampled."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.geometry.scene import Material, Mesh, SceneObject
from solver.pathtracing.estimate import ProgressiveEstimate
from solver.pathtracing.lobes import Lobes
from solver.pathtracing.sources import PointSource
from solver.pathtracing.tables import Emitters, ShadingTables, build_tables
from solver.visibility.rays import RayScene
from tests.pathtracing.agreement import assert_agrees
from tests.pathtracing.test_known_answers import UP, corner_rectangle, patch_irradiance
from tests.pathtracing.views import looking, radiance
from tests.pathtracing.worlds import CUBE, INWARD, OUTWARD, cube, material, polygon, square, tracer, world

COLOURS = np.array([0.8, 0.5, 0.1])


def box(of: Material) -> SceneObject:
    return SceneObject("box", Mesh(CUBE, INWARD), of)


# --- mirrors ---


def test_lamp_seen_in_a_mirror() -> None:
    """Its radiance, times what the mirror reflects; without any scatter, and from both sides of the glass."""
    lamps = [square(f"lamp{z}", material(emission=2.0), z, z > 0.0, -9.0, 9.0) for z in (-3.0, 3.0)]
    of = tracer(square("mirror", material(specular=COLOURS, two_sided=True), 0.0, low=-9.0, high=9.0), *lamps)
    for z in (-1.0, 1.0):
        seen, error = radiance(of, looking((0.5, 0.5, z), (1.5, 0.5, 0.0)))
        np.testing.assert_allclose(seen, COLOURS * 2.0 / np.pi, rtol=1e-12)
        assert error.max() < 1e-12


def test_lamp_seen_in_a_mirror_in_a_mirror() -> None:
    """A periscope: two slanted mirrors show what is behind the corner."""
    silver = material(specular=COLOURS)
    lower = polygon("lower", [[0, 0, -1], [0, 1, -1], [2, 1, 1], [2, 0, 1]][::-1], silver)
    upper = polygon("upper", [[0, 0, 3], [0, 1, 3], [2, 1, 5], [2, 0, 5]], silver)
    lamp = polygon("lamp", [[5, -9, -9], [5, 9, -9], [5, 9, 9], [5, -9, 9]][::-1], material(emission=1.0))
    seen, error = radiance(tracer(lower, upper, lamp), looking((-1.0, 0.5, 0.0), (0.0, 0.5, 0.0)))
    np.testing.assert_allclose(seen, COLOURS**2 / np.pi, rtol=1e-9)
    assert error.max() < 1e-12


@pytest.mark.parametrize("height", [0.05, 0.25, 0.9])
def test_a_mirror_floor_lights_a_wall_as_the_image_of_the_lamp_does(height: float) -> None:
    """An upright lamp before an upright receiver: direct light, and that of the lamp below the floor."""
    lamp = polygon("lamp", [[1, 0, 1], [1, 0, 2], [1, 1, 2], [1, 1, 1]], material(emission=4.0))
    of = tracer(lamp, square("floor", material(specular=COLOURS), 0.0, low=-9.0, high=9.0))
    mean, error = of.irradiance(np.array([[0.0, 0.0, height]]), np.array([[1.0, 0.0, 0.0]]), 1 << 15)

    def strip(low: float, high: float) -> float:
        return corner_rectangle(1.0, high, 1.0) - corner_rectangle(1.0, low, 1.0)

    direct, image = strip(1.0 - height, 2.0 - height), strip(1.0 + height, 2.0 + height)
    assert_agrees(mean[0], error[0], 4.0 * (direct + COLOURS * image))
    assert (error / mean).max() < 0.01


def test_the_back_of_a_one_sided_mirror_is_black() -> None:
    lamp = square("lamp", material(emission=2.0), -3.0, low=-9.0, high=9.0)
    of = tracer(square("mirror", material(specular=0.9), 0.0), lamp)
    seen, _ = radiance(of, looking((0.5, 0.5, -1.0), (0.5, 0.5, 0.0)))
    assert not seen.any()


# --- furnaces and balances ---


@pytest.mark.parametrize(
    ("diffuse", "specular", "emission"),
    [
        (0.3, 0.4, 1.0),
        (0.0, 0.8, 1.0),
        ((0.2, 0.0, 0.5), (0.1, 0.7, 0.4), (3.0, 2.0, 1.0)),
        # What is diffuse in one channel and specular in another: the way to go is weighed by channels.
        ((0.9, 0.0, 0.0), (0.0, 0.0, 0.9), 1.0),
    ],
)
def test_furnace_with_mirror_walls(
    diffuse: float | tuple[float, ...],
    specular: float | tuple[float, ...],
    emission: float | tuple[float, ...],
) -> None:
    """Radiance is the same everywhere: E / pi / (1 - rho), rho being both reflectances together."""
    paint = material(diffuse, emission, specular=specular)
    of = tracer(box(paint), SceneObject("block", Mesh(0.3 + 0.25 * CUBE, OUTWARD), paint))
    mean, error = patch_irradiance(of, 8192)
    truth = paint.emission / (1.0 - paint.reflectance - paint.specular)
    assert_agrees(mean, error, np.tile(truth, (len(mean), 1)))
    assert (error / truth).max() < 0.05, "too noisy to find anything"


def test_walls_of_mirrors_and_of_paint_make_one_furnace() -> None:
    faces = [
        SceneObject(f"face{k}", Mesh(CUBE, (face,)), material(*paint, specular=0.7 - paint[0]))
        for k, (face, paint) in enumerate(zip(INWARD, [(0.7, 1.0), (0.0, 1.0), (0.4, 1.0)] * 2, strict=True))
    ]
    mean, error = patch_irradiance(tracer(*faces), 1 << 14)
    assert_agrees(mean, error, 1.0 / 0.3)


@pytest.mark.parametrize("exponent", [0.0, 3.0, 1000.0])
def test_gloss_in_a_furnace_lies_between_paint_and_mirror(exponent: float) -> None:
    """A lobe reflects less than its reflectance where light is slanted, so the room is darker."""
    of = tracer(box(material(0.2, 1.0, specular=0.6, exponent=exponent)))
    mean, error = patch_irradiance(of, 4096)
    assert (mean + 5.0 * error > 1.0 / 0.8).all() and (mean - 5.0 * error < 1.0 / 0.2).all()
    assert (error / mean).max() < 0.02


@st.composite
def paints(draw: st.DrawFn) -> Material:
    """A material of any kind, of albedo 0.9 at most."""
    total, split = (np.array([draw(st.floats(0, most)) for _ in range(3)]) for most in (0.9, 1.0))
    return material(
        (total * split).tolist(),
        draw(st.sampled_from([0.0, 1.0, 5.0])),
        specular=(total * (1.0 - split)).tolist(),
        exponent=draw(st.just(math.inf) | st.floats(0, 10) | st.floats(10, 1e6)),
        emission_exponent=draw(st.just(0.0) | st.floats(0, 10)),
    )


@settings(max_examples=20)
@given(st.lists(paints(), min_size=6, max_size=6))
def test_energy_that_surfaces_take_is_what_lamps_give(walls: list[Material]) -> None:
    """In a closed box. Of what it gets a mirror takes 1 - rho_d - rho_s, a lobe more, but not 1 - rho_d."""
    of = tracer(*(SceneObject(str(k), Mesh(CUBE, (INWARD[k],)), paint) for k, paint in enumerate(walls)))
    s = of.surfaces
    mean, error = patch_irradiance(of, 1024)
    given_out = s.emission.sum(axis=0)
    least = 1.0 - s.reflectance - s.specular
    most = np.where(np.isinf(s.exponent)[:, None], least, 1.0 - s.reflectance)
    for part, sign in ((least, 1.0), (most, -1.0)):
        taken, noise = (part * mean).sum(axis=0), np.sqrt(((part * error) ** 2).sum(axis=0))
        assert np.all(sign * (taken - given_out) <= 5.0 * noise + 1e-9)


# --- how it is sampled ---


def estimated(rays: RayScene, tables: ShadingTables, emitters: Emitters, samples: int) -> ProgressiveEstimate:
    """The irradiance of three points, of one level and normal."""
    points = np.array([[0.2, 0.2, 0.3], [0.5, 0.6, 0.3], [0.9, 0.1, 0.3]])
    estimate = ProgressiveEstimate(
        rays, tables, emitters, PointSource(points, np.tile(UP, (3, 1))), samples, 5, 32
    )
    estimate.run()
    return estimate


@pytest.mark.parametrize("exponent", [0.5, 40.0, math.inf])
def test_shadow_rays_change_nothing_but_the_noise(exponent: float) -> None:
    """Through many bounces of lobes, mirrors, paint and directional lamps: as rays alone would have it."""
    gloss = material(0.2, (0.3, 0.1, 0.0), specular=0.6 * COLOURS, exponent=exponent)
    lamp = square("lamp", material(0.1, 5.0, specular=0.3, emission_exponent=3.0), 0.9, True, 0.2, 0.8)
    mirror = square("mirror", material(specular=0.8, two_sided=True), 0.5, low=0.4, high=0.7)
    surfaces = world(box(gloss), lamp, mirror).surfaces
    rays = RayScene(surfaces.triangles, surfaces.center, surfaces.size)
    tables, emitters = build_tables(surfaces, rays)
    nowhere = np.empty((0, 3))
    none = Emitters(np.zeros(1), nowhere, nowhere, nowhere, np.empty(0, dtype=np.int32))
    unsampled = tables._replace(density=np.where(tables.density > 0.0, 1e-300, 0.0))
    with_them = estimated(rays, tables, emitters, 256)
    without = estimated(rays, unsampled, none, 4096)
    assert_agrees(with_them.mean, with_them.standard_error, without.mean, without.standard_error)
    assert (without.standard_error / without.mean).max() < 0.02
    assert with_them.ray_count < without.ray_count


def test_lobes_that_say_nothing_change_nothing() -> None:
    """To the last bit: a diffuse patch shades alike whether or not others have lobes."""
    surfaces = cube([0.3, 0.5, 0.7, 0.2, 0.6, 0.4], [0.0, 0.0, 5.0, 0.0, 0.0, 0.0]).surfaces
    rays = RayScene(surfaces.triangles, surfaces.center, surfaces.size)
    tables, emitters = build_tables(surfaces, rays)
    assert tables.lobes is None
    n = surfaces.patch_count
    idle = Lobes(np.zeros((n, 3)), np.full(n, np.inf), np.zeros(n), np.zeros(n, dtype=bool))
    found = [estimated(rays, t, emitters, 64).mean for t in (tables, tables._replace(lobes=idle))]
    np.testing.assert_array_equal(found[0], found[1])
