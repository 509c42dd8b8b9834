"""Lobes: reciprocal, never brighter than what comes in, and sampled by the densities that they claim."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.geometry.scene import Material
from solver.kernels import kernel
from solver.pathtracing.lobes import Lobes, build_lobes, emission_lobe, mirrored, phong_lobe, specular_chance
from solver.pathtracing.sampling import pair
from solver.pathtracing.specular import Scattering, scattered_direction
from solver.types import FloatArray
from tests.pathtracing.worlds import material, square, world

DIRECTIONS = (
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.01, 1))
    .filter(lambda d: np.linalg.norm(d) > 0.1)
    .map(lambda d: np.array(d) / np.linalg.norm(d))
)
"""Unit vectors above the plane z = 0."""
EXPONENTS = st.floats(0, 5) | st.floats(5, 1e6)


@cache
def polar(count: int, exponent: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Nodes (n, 3) and weights (n,) over the hemisphere about z, as many as cos^(exponent + 1) wants them."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    cosine = (0.5 * (nodes + 1.0)) ** (1.0 / (exponent + 2.0))
    measure = np.pi * weights / (exponent + 2.0) / cosine ** (exponent + 1.0)
    phi = np.pi * (np.arange(2 * count) + 0.5) / count
    sine = np.sqrt(1.0 - cosine**2)
    points = np.stack(
        np.broadcast_arrays(sine[:, None] * np.cos(phi), sine[:, None] * np.sin(phi), cosine[:, None]),
        axis=-1,
    )
    return points.reshape(-1, 3), np.repeat(measure / (2 * count), 2 * count)


@kernel
def lobe_over(directions: FloatArray, r: FloatArray, exponent: float, out: FloatArray) -> None:
    for k in range(len(directions)):
        cosine = directions[k, 0] * r[0] + directions[k, 1] * r[1] + directions[k, 2] * r[2]
        out[k] = phong_lobe(exponent, cosine)


@kernel
def scatter(stream: np.uint64, r: FloatArray, exponent: float, chance: float, out: FloatArray) -> None:
    """Directions that paths choose about z and the mirrored r, and their densities and weights."""
    scattering = Scattering(0, exponent, r[0], r[1], r[2], chance)
    for k in range(len(out)):
        u, v = pair(stream, np.uint64(k), 0)
        chosen = scattered_direction(scattering, 0.0, 0.0, 1.0, u, v)
        for column in range(6):
            out[k, column] = chosen[column]


def scattered(r: FloatArray, exponent: float, specular: float = 1.0) -> FloatArray:
    """Of light of 1 that a mirror would send along r: how much is reflected, and that times its direction."""
    about_z, weights = polar(96, exponent)
    # The nodes are laid about the mirrored direction.
    x = np.cross(r, [0.0, 1.0, 0.0] if abs(r[1]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    directions = about_z @ np.stack([x, np.cross(r, x), r])
    lobe = np.empty(len(directions))
    lobe_over(directions, r, exponent, lobe)
    light = specular * weights * lobe * np.maximum(directions[:, 2], 0.0) / np.pi
    # A diffuse surface reflects 2/3 along its normal.
    diffuse = (1.0 - specular) * np.array([1.0, 0.0, 0.0, 2.0 / 3.0])
    return np.asarray(diffuse + np.array([light.sum(), *(light @ directions)]))


# --- reflection ---


@given(DIRECTIONS, DIRECTIONS, EXPONENTS)
def test_a_lobe_is_reciprocal(one: FloatArray, other: FloatArray, exponent: float) -> None:
    """The same either way: light from one reflected to the other, and back."""

    def reflected(source: FloatArray, to: FloatArray) -> float:
        r = mirrored(-source[0], -source[1], -source[2], 0.0, 0.0, 1.0)
        return phong_lobe(exponent, float(np.dot(r, to)))

    there, back = reflected(one, other), reflected(other, one)
    assert there == pytest.approx(back, rel=1e-8, abs=1e-300)


@given(DIRECTIONS, EXPONENTS)
def test_a_lobe_reflects_no_more_than_its_reflectance(r: FloatArray, exponent: float) -> None:
    assert scattered(r, exponent)[0] <= 1.0 + 1e-3


@pytest.mark.parametrize("exponent", [0.0, 0.3, 1.0, 7.0, 100.0, 1e4, 1e6])
def test_along_the_normal_a_lobe_reflects_just_its_reflectance(exponent: float) -> None:
    assert scattered(np.array([0.0, 0.0, 1.0]), exponent)[0] == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("angle", [0.3, 0.8, 1.3])
def test_a_narrow_lobe_reflects_as_the_cosine_of_incidence(angle: float) -> None:
    r = np.array([math.sin(angle), 0.0, math.cos(angle)])
    assert scattered(r, 1e6)[0] == pytest.approx(math.cos(angle), rel=1e-3)


def test_a_lobe_ends_at_a_right_angle_and_a_mirror_has_none() -> None:
    assert phong_lobe(0.0, 1e-9) == 1.0 and phong_lobe(0.0, 0.0) == phong_lobe(0.0, -0.5) == 0.0
    assert phong_lobe(math.inf, 1.0) == 0.0


@given(DIRECTIONS, DIRECTIONS)
def test_mirroring_keeps_length_and_height(d: FloatArray, n: FloatArray) -> None:
    r = np.array(mirrored(*(-d), *n))
    assert np.linalg.norm(r) == pytest.approx(1.0)
    assert np.dot(r, n) == pytest.approx(np.dot(d, n), abs=1e-12)
    assert np.linalg.norm(np.cross(r - d, n)) == pytest.approx(2.0 * np.linalg.norm(np.cross(d, n)), abs=1e-6)


# --- sampling ---


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 20.0, 1000.0])
@pytest.mark.parametrize("height", [0.05, 0.6, 1.0])
@pytest.mark.parametrize("specular", [0.3, 1.0])
def test_directions_have_the_density_that_is_claimed(exponent: float, height: float, specular: float) -> None:
    """What is reflected, and where to, comes out with bounded weights; below the surface there is nothing."""
    r = np.array([math.sqrt(1.0 - height**2), 0.0, height])
    chance = specular_chance(exponent, specular, 1.0 - specular)
    out = np.empty((2**15, 6))
    scatter(np.uint64(5), r, exponent, chance, out)
    directions, spread, by_cosine, by_lobe = out[:, :3], out[:, 3], out[:, 4], out[:, 5]
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    above = directions[:, 2] > 0.0
    assert np.array_equal(spread > 0.0, above) and not by_lobe[~above].any()
    np.testing.assert_allclose(by_cosine[above] * spread[above], directions[above, 2])
    weight = (1.0 - specular) * by_cosine + specular * by_lobe
    assert weight.max() <= 1.5 + 1e-9
    found = np.array([weight.sum(), *(weight @ directions)]) / len(out)
    np.testing.assert_allclose(found, scattered(r, exponent, specular), atol=3e-3)


@given(EXPONENTS, st.floats(1e-6, 1), st.floats(0, 1))
def test_chances_leave_room_for_the_cosine(exponent: float, specular: float, diffuse: float) -> None:
    chance = specular_chance(exponent, specular, diffuse)
    assert 0.0 <= chance < 1.0
    assert specular_chance(0.0, specular, diffuse) == 0.0
    assert specular_chance(math.inf, specular, diffuse) == specular / (specular + diffuse)


# --- emission ---


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 20.0, 1e4])
def test_directional_emission_keeps_its_exitance(exponent: float) -> None:
    built = build_lobes(
        world(square("lamp", material(emission=1.0, emission_exponent=exponent), 0.0)).surfaces
    )
    points, weights = polar(48, exponent)
    lobe = np.array([emission_lobe(built, 0, z, 1.0) for z in points[:, 2]])
    # Radiance is lobe / pi for an exitance of 1.
    assert np.sum(weights * lobe * points[:, 2]) / np.pi == pytest.approx(1.0, rel=1e-9)


def test_only_what_is_not_diffuse_makes_lobes() -> None:
    def lobes(of: Material) -> Lobes | None:
        return build_lobes(world(square("a", of, z=0.0)).surfaces)

    assert lobes(material(0.5, 1.0)) is None
    assert lobes(material(0.5, exponent=5.0)) is None, "nothing is reflected by it"
    assert lobes(material(0.5, emission_exponent=5.0)) is None, "nothing is emitted"
    assert lobes(material(0.5, specular=0.1)) is not None
    assert lobes(material(0.5, 1.0, emission_exponent=5.0)) is not None
