"""Lobes of lights and of what they shine on, by lights and by rays; and few glossy lights for many."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.illumination.particles.compensation import NearbyLight
from solver.illumination.particles.glossy import GlossyLight, gloss_of, lobe_axis, lobe_factor
from solver.illumination.particles.light_lobes import Gloss
from solver.illumination.particles.lighting import ShiningLights, add_light
from solver.illumination.particles.lights import VirtualLights
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.sights import look_around
from solver.illumination.particles.thinning import thinned
from solver.types import Float32Array, FloatArray
from tests.illumination.particles.rooms import GREY, LAMP, Room, cube, material, room, scatter, square
from tests.illumination.particles.shining import lamps

FLOOR = np.zeros(1, dtype=np.int32)


def floor(exponent: float = 20.0) -> Room:
    """A glossy floor, 4 m square, and a matt ceiling."""
    return room(
        square("floor", material(0.2, specular=0.5, exponent=exponent), 0.0, low=-2.0, high=2.0),
        square("ceiling", GREY, 2.0, down=True, low=-2.0, high=2.0),
    )


def one_light(gloss: float, incident: FloatArray) -> VirtualLights:
    """A light of 1 W in the ceiling, over the middle of the floor, glossy with gloss >= 0."""
    plain = lamps(np.array([[0.0, 0.0, 2.0]]), np.array([0.0, 0.0, -1.0]))
    return replace(plain, gloss=np.array([gloss]), incident=incident[None])


def shone(of: Room, lights: VirtualLights, points: FloatArray, gloss: Gloss | None = None) -> FloatArray:
    """Irradiance (n,) of points on the floor, by lobes where given."""
    polygons = Polygons.of(of.surfaces)
    shining = ShiningLights.all_of(polygons, lights)
    sights = look_around(of.rays, polygons, shining.frames)
    receivers = Receivers.on(polygons, points, np.zeros(len(points), dtype=np.int32))
    light: Float32Array = np.zeros((3, len(points)), dtype=np.float32)
    add_light(light, receivers, shining, sights, math.inf, None, gloss)
    return np.asarray(light[0], dtype=np.float64)


POINTS = np.array([[0.0, 0.0, 0.0], [0.5, 0.2, 0.0], [-1.5, 0.3, 0.0], [1.9, 1.9, 0.0]])


@pytest.mark.parametrize("gloss", [0.0, 3.0, 40.0, 1e4])
def test_a_glossy_light_shines_about_the_mirrored_direction(gloss: float) -> None:
    """P (n + 2) / (2 pi) cos^n(alpha) cos cos' / r^2, and nothing beyond a right angle."""
    incident = np.array([-0.5, 0.1, 0.4])
    incident /= np.linalg.norm(incident)
    way = POINTS - [0.0, 0.0, 2.0]
    distance = np.linalg.norm(way, axis=1)
    alpha = np.maximum(way @ (incident * [1.0, 1.0, -1.0]) / distance, 0.0)
    expected = (
        (gloss + 2.0) / (2.0 * math.pi) * alpha**gloss * (alpha > 0.0) * (2.0 / distance) ** 2 / distance**2
    )
    found = shone(floor(), one_light(gloss, incident), POINTS)
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-9 * (gloss + 2.0))


@given(n=st.floats(0.0, 64.0), x=st.floats(-3.0, 3.0), y=st.floats(-3.0, 3.0), z=st.floats(0.1, 3.0))
def test_light_counts_by_the_lobe_towards_the_eye(n: float, x: float, y: float, z: float) -> None:
    of, eye = floor(n), np.array([x, y, z])
    along = POINTS - eye
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    patch = np.zeros(len(POINTS), dtype=np.int32)
    axis = lobe_axis(of.surfaces, patch, along)
    gloss = gloss_of(of.surfaces, patch, axis)
    light = one_light(-1.0, np.zeros(3))
    to_light = light.position - POINTS
    to_light /= np.linalg.norm(to_light, axis=1, keepdims=True)
    cosine = np.maximum(np.einsum("na,na->n", axis, to_light), 0.0)
    factor = np.where(cosine > 0.0, 0.5 * (n + 2.0) * cosine**n, 0.0)
    plain = shone(of, light, POINTS)
    np.testing.assert_allclose(shone(of, light, POINTS, gloss), factor * plain, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(lobe_factor(gloss, to_light), factor, rtol=1e-4, atol=1e-6)


def dark(receivers: Receivers, turn: int) -> Float32Array:
    return np.zeros((3, len(receivers)), dtype=np.float32)


def dark_lobes(receivers: Receivers, gloss: Gloss, turn: int) -> Float32Array:
    return dark(receivers, turn)


@pytest.mark.parametrize("exponent", [1.0, 30.0, 1000.0])
def test_rays_by_lobes_reflect_what_the_lobe_does_of_an_even_sky(exponent: float) -> None:
    """Under an emitting ceiling without end a lobe about the normal reflects rho_s L."""
    of = room(
        square("floor", material(0.0, specular=0.5, exponent=exponent), 0.0),
        square("sky", material(0.0, 1.0), 1.0, down=True, low=-500.0, high=500.0),
    )
    polygons = Polygons.of(of.surfaces)
    lobes = GlossyLight(of.surfaces, polygons, of.rays, dark_lobes)
    near = NearbyLight(of.surfaces, polygons, of.rays, math.inf, dark, None, lobes)
    n = 64
    points = np.full((n, 3), [0.5, 0.5, 0.0])
    patch, stream = np.zeros(n, dtype=np.int32), np.arange(n, dtype=np.int64)
    axis = np.tile([0.0, 0.0, 1.0], (n, 1))
    found = [lobes.by_rays(near, points, patch, axis, stream, turn).mean() for turn in range(32)]
    np.testing.assert_allclose(np.mean(found), 1.0, rtol=5e-3)


def test_lobes_by_lights_and_by_rays_show_the_same_lamp() -> None:
    """A highlight of a lobe that is neither broad nor very narrow."""
    of = room(
        square("floor", material(0.0, specular=0.5, exponent=64.0), 0.0, low=-2.0, high=2.0),
        square("lamp", material(0.0, 1.0), 1.0, down=True, low=-0.2, high=0.2),
    )
    polygons = Polygons.of(of.surfaces)
    n = 32
    points, patch = np.full((n, 3), [0.5, 0.1, 0.0]), np.zeros(n, dtype=np.int32)
    along = points - [1.5, 0.0, 1.2]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    axis = lobe_axis(of.surfaces, patch, along)
    by_lights = shone(of, of.block(2048), points, gloss_of(of.surfaces, patch, axis))
    lobes = GlossyLight(of.surfaces, polygons, of.rays, dark_lobes)
    near = NearbyLight(of.surfaces, polygons, of.rays, math.inf, dark, None, lobes)
    streams = np.arange(n, dtype=np.int64)
    turns = [lobes.by_rays(near, points, patch, axis, streams, turn)[0] for turn in range(512)]
    np.testing.assert_allclose(np.mean(turns, axis=0), by_lights, rtol=0.1)
    np.testing.assert_allclose(np.mean(turns), by_lights[0], rtol=0.01)


@given(st.floats(0.0, 1e4), st.integers(0, 2**20))
def test_no_lobe_reflects_more_than_came_in(exponent: float, stream: int) -> None:
    """In a furnace without diffuse reflection, from any side: rho_s E at most."""
    of = cube(material(0.0, 1.0, specular=0.6, exponent=exponent))
    polygons = Polygons.of(of.surfaces)

    def nothing(receivers: Receivers, gloss: Gloss, turn: int) -> Float32Array:
        return dark(receivers, turn)

    lobes = GlossyLight(of.surfaces, polygons, of.rays, nothing)
    near = NearbyLight(of.surfaces, polygons, of.rays, math.inf, dark, None, None)
    random = np.random.default_rng(stream)
    n = 400
    axis = random.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    axis[:, 2] = np.abs(axis[:, 2])
    patch, points = np.zeros(n, dtype=np.int32), np.full((n, 3), [0.4, 0.3, 0.0])
    found = lobes.by_rays(near, points, patch, axis, np.arange(n, dtype=np.int64), 0)
    # The lobe as it is drawn weighs (n + 2) / (n + 1) cos, of which the mean is 1 at most.
    assert found.mean() <= 1.0 + 3.0 * found.std() / math.sqrt(n)


def test_few_glossy_lights_shine_as_all_of_them_in_the_mean() -> None:
    """Each keeps its lobe and its direction; also those that differ in all of it."""
    shiny = material(0.2, specular=(0.3, 0.6, 0.1), exponent=30.0)
    of = cube(shiny, LAMP, GREY, shiny, GREY, material((0.1, 0.5, 0.9), specular=0.05, exponent=2.0))
    lights = of.block(512)
    glossy = lights.gloss >= 0.0
    assert np.any(glossy) and not np.all(glossy)
    way = np.array([0.48, 0.6, 0.64])

    def sent(of_lights: VirtualLights) -> FloatArray:
        """What lights send about one direction, per channel, and by glossy ones alone."""
        shining = ShiningLights.all_of(Polygons.of(of.surfaces), of_lights)
        lobe = np.maximum(shining.frames[12:].T @ way, 0.0) ** (shining.lobe - 1.0)
        power = shining.power * lobe[:, None]
        return np.concatenate([power.sum(axis=0), power[of_lights.gloss >= 0.0].sum(axis=0)])

    found, error = scatter([sent(thinned(lights, of.surfaces, 64, seed)) for seed in range(300)])
    emitted = thinned(lights, of.surfaces, 64, 0)
    kept = emitted.take(np.flatnonzero(emitted.generation == 0))
    reflected = lights.take(np.flatnonzero(lights.generation > 0))
    np.testing.assert_array_less(np.abs(found - sent(kept) - sent(reflected)), 4.0 * error)
