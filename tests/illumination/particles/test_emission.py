"""Points on patches and directions in lobes: of the right density, without seams."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import stats

from solver.illumination.particles.emission import Emitters, choose, lobe_direction, point_on_patch
from solver.illumination.particles.radical_inverse import halton_points
from solver.types import FloatArray
from tests.illumination.particles.rooms import material, polygon, room, square

SQUARE = st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
EXPONENTS = st.sampled_from([0.0, 0.5, 1.0, 2.0, 10.0, 1000.0, 1e6])


def quad_at(angles: list[float], lift: float) -> FloatArray:
    """A convex quadrilateral (4, 3) on an ellipse, tilted."""
    turned = np.sort(angles)
    plane = np.stack([2.0 * np.cos(turned), np.sin(turned)], axis=1)
    return np.asarray(plane @ np.array([[1.0, 0.0, lift], [0.0, 1.0, -lift]]))


def normal_of(corners: FloatArray) -> FloatArray:
    doubled = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    if np.array_equal(corners[2], corners[3]):
        doubled = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return np.asarray(doubled / np.linalg.norm(doubled))


def area_of(polygon: FloatArray) -> float:
    return float(
        0.5 * np.linalg.norm(np.cross(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0]).sum(axis=0))
    )


def place(corners: FloatArray, u: float, v: float) -> FloatArray:
    return np.array(point_on_patch(corners, normal_of(corners), u, v))


def outline(corners: FloatArray, u: tuple[float, float], v: tuple[float, float]) -> FloatArray:
    """What becomes of a rectangle's border, in order."""
    t = np.linspace(0.0, 1.0, 60)
    low_u, high_u = u
    low_v, high_v = v
    ways = [
        (low_u + t * (high_u - low_u), np.full_like(t, low_v)),
        (np.full_like(t, high_u), low_v + t * (high_v - low_v)),
        (high_u - t * (high_u - low_u), np.full_like(t, high_v)),
        (np.full_like(t, low_u), high_v - t * (high_v - low_v)),
    ]
    return np.array([place(corners, a, b) for us, vs in ways for a, b in zip(us, vs, strict=True)])


@given(
    st.lists(st.floats(0.0, 2.0 * math.pi), min_size=4, max_size=4),
    st.floats(-2.0, 2.0),
    st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4),
    st.booleans(),
)
def test_area_is_preserved(angles: list[float], lift: float, box: list[float], triangle: bool) -> None:
    """What becomes of any rectangle of the square has its share of the patch's area."""
    assume(min(np.diff(np.sort(angles))) > 0.05 and 2.0 * math.pi - np.ptp(angles) > 0.05)
    corners = quad_at(angles, lift)
    if triangle:
        corners[3] = corners[2]
    u, v = sorted(box[:2]), sorted(box[2:])
    image = outline(corners, (u[0], u[1]), (v[0], v[1]))
    share = area_of(image) / area_of(corners)
    # As far as the outline is straight between its points.
    assert share == pytest.approx((u[1] - u[0]) * (v[1] - v[0]), abs=1e-3)


@given(st.lists(st.floats(0.0, 2.0 * math.pi), min_size=4, max_size=4), SQUARE)
def test_points_are_inside(angles: list[float], at: tuple[float, float]) -> None:
    assume(min(np.diff(np.sort(angles))) > 0.01 and 2.0 * math.pi - np.ptp(angles) > 0.01)
    corners = quad_at(angles, 0.5)
    found, normal = place(corners, *at), normal_of(corners)
    edges = np.roll(corners, -1, axis=0) - corners
    assert np.all(np.cross(edges, found - corners) @ normal >= -1e-12)
    assert abs((found - corners[0]) @ normal) < 1e-12


@given(SQUARE)
def test_parallelograms_are_reached_by_an_affine_map(at: tuple[float, float]) -> None:
    a, b, c = np.array([1.0, 2.0, 3.0]), np.array([2.0, 0.5, 0.0]), np.array([0.3, 1.0, -1.0])
    corners = np.array([a, a + b, a + b + c, a + c])
    np.testing.assert_allclose(place(corners, *at), a + at[0] * b + at[1] * c, atol=1e-12)


@given(SQUARE, st.floats(0.0, 2.0 * math.pi), st.booleans())
def test_neighbours_stay_neighbours(at: tuple[float, float], way: float, triangle: bool) -> None:
    """No seam: a small step in the square is a small step on the patch."""
    corners = np.array([[0.0, 0, 0], [3, 0, 0], [2, 1, 0], [0.5, 2, 0]])
    if triangle:
        corners[3] = corners[2]
    step = 1e-6
    other = np.clip(np.array(at) + step * np.array([math.cos(way), math.sin(way)]), 0.0, 1.0)
    assert np.linalg.norm(place(corners, *at) - place(corners, *other)) < 8.0 * math.sqrt(step)
    if max(at[1], other[1]) < 0.99:
        assert np.linalg.norm(place(corners, *at) - place(corners, *other)) < 40.0 * step


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=9), st.floats(0.0, 1.0, exclude_max=True))
def test_choice_is_by_the_table_and_the_rest_is_uniform_again(weights: list[float], u: float) -> None:
    assume(sum(weights) > 1e-3)
    cumulative = np.concatenate([[0.0], np.cumsum(weights) / sum(weights)])
    cumulative[-1] = 1.0
    k, rest = choose(cumulative, u)
    assert cumulative[k] <= u < cumulative[k + 1]
    assert 0.0 <= rest < 1.0
    assert cumulative[k] + rest * (cumulative[k + 1] - cumulative[k]) == pytest.approx(u, abs=1e-12)


def test_emitters_are_chosen_by_their_luminous_power() -> None:
    s = room(
        square("white", material(emission=2.0), z=0.0, high=2.0),
        square("floor", material(0.5), z=-1.0),
        polygon("red", [[0, 0, 1], [1, 0, 1], [0, 1, 1]], material(emission=(10.0, 0, 0), two_sided=True)),
    ).surfaces
    emitters = Emitters.of(s)
    assert emitters.patch.tolist() == [0, 2, 3]
    power = np.array([8.0, 5.0 * 0.2126, 5.0 * 0.2126])
    np.testing.assert_allclose(np.diff(emitters.cumulative), power / power.sum())
    np.testing.assert_allclose(emitters.emitted, [18.0, 8.0, 8.0])
    # What a path stands for, times its probability, is the patch's power.
    found = emitters.power * np.diff(emitters.cumulative)[:, None]
    np.testing.assert_allclose(found, [[8.0, 8.0, 8.0], [5.0, 0.0, 0.0], [5.0, 0.0, 0.0]], atol=1e-12)


def test_without_light_there_are_no_emitters() -> None:
    emitters = Emitters.of(room(square("floor", material(0.5), z=0.0)).surfaces)
    assert len(emitters.patch) == 0 and not emitters.emitted.any()


@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda n: np.linalg.norm(n) > 1e-3),
    EXPONENTS,
    SQUARE,
)
def test_directions_are_unit_and_not_below(
    axis: list[float], exponent: float, at: tuple[float, float]
) -> None:
    nx, ny, nz = (part / float(np.linalg.norm(axis)) for part in axis)
    direction = lobe_direction(nx, ny, nz, exponent, *at)
    assert np.linalg.norm(direction) == pytest.approx(1.0, abs=1e-12)
    assert np.dot(direction, (nx, ny, nz)) >= -1e-12


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 3.0, 100.0])
def test_directions_have_the_density_of_their_lobe(exponent: float) -> None:
    """cos^(k + 1) is uniform, and so is the angle around the axis."""
    axis = (0.6, -0.64, -0.48)
    found = np.array([lobe_direction(*axis, exponent, *at) for at in halton_points(1, 4001, 2)])
    cosine = found @ axis
    assert stats.kstest(cosine ** (exponent + 1.0), "uniform").statistic < 0.01
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    around = np.arctan2(found @ np.cross(axis, side), found @ side)
    assert stats.kstest(around / (2.0 * math.pi) + 0.5, "uniform").statistic < 0.02


@given(SQUARE, st.floats(0.0, 2.0 * math.pi))
def test_directions_of_neighbours_are_neighbours(at: tuple[float, float], way: float) -> None:
    step = 1e-6
    other = np.clip(np.array(at) + step * np.array([math.cos(way), math.sin(way)]), 0.0, 1.0)
    first, second = (np.array(lobe_direction(0.0, 0.0, 1.0, 1.0, *uv)) for uv in (at, other))
    assert np.linalg.norm(first - second) < 4.0 * math.sqrt(step)
