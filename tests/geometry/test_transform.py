"""Affine placement: the order of its parts, and which transforms mirror."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.geometry.transform import Transform
from solver.types import FloatArray

NUMBERS = st.floats(-10, 10)
TRIPLES = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
SCALES = st.tuples(*[st.sampled_from([-2.0, -0.5, 0.1, 1.0, 3.0])] * 3).map(np.array)
QUATERNIONS = (
    st.tuples(*[st.floats(-1, 1)] * 4).map(np.array).filter(lambda q: float(np.linalg.norm(q)) > 1e-3)
)
POINTS = st.lists(TRIPLES, min_size=1, max_size=5).map(np.array)
QUARTER = np.sqrt(0.5)


def rotation(q: FloatArray) -> Transform:
    return Transform.from_parts(np.zeros(3), q, np.ones(3))


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Hamilton's product of quaternions x, y, z, w: b first, then a."""
    (*u, s), (*v, t) = a.tolist(), b.tolist()
    return np.append(s * np.array(v) + t * np.array(u) + np.cross(u, v), s * t - np.dot(u, v))


@given(POINTS)
def test_identity_changes_nothing(points: FloatArray) -> None:
    np.testing.assert_array_equal(Transform.identity().apply(points), points)


@given(TRIPLES, QUATERNIONS, SCALES, POINTS)
def test_scale_then_rotate_then_translate(
    shift: FloatArray, q: FloatArray, scale: FloatArray, points: FloatArray
) -> None:
    whole = Transform.from_parts(shift, q, scale).apply(points)
    np.testing.assert_allclose(whole, rotation(q).apply(points * scale) + shift, atol=1e-12)


@pytest.mark.parametrize(
    ("q", "expected"),
    [
        ([QUARTER, 0, 0, QUARTER], [[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
        ([0, QUARTER, 0, QUARTER], [[0, 0, -1], [0, 1, 0], [1, 0, 0]]),
        ([0, 0, QUARTER, QUARTER], [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    ],
    ids=["x", "y", "z"],
)
def test_quarter_turns_are_right_handed(q: list[float], expected: list[list[float]]) -> None:
    np.testing.assert_allclose(rotation(np.array(q)).apply(np.eye(3)), expected, atol=1e-15)


@given(QUATERNIONS, POINTS)
def test_rotation_keeps_lengths_and_handedness(q: FloatArray, points: FloatArray) -> None:
    turn = rotation(q)
    linear = turn.matrix[:3, :3]
    np.testing.assert_allclose(linear @ linear.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(linear) == pytest.approx(1.0)
    np.testing.assert_allclose(
        np.linalg.norm(turn.apply(points), axis=1), np.linalg.norm(points, axis=1), atol=1e-9
    )


@given(QUATERNIONS, st.floats(0.01, 100))
def test_length_and_sign_of_a_quaternion_do_not_matter(q: FloatArray, factor: float) -> None:
    for same in (factor * q, -q):
        np.testing.assert_allclose(rotation(same).matrix, rotation(q).matrix, atol=1e-12)


@given(QUATERNIONS, QUATERNIONS, POINTS)
def test_rotations_compose_as_quaternions_do(a: FloatArray, b: FloatArray, points: FloatArray) -> None:
    both = rotation(product(a / np.linalg.norm(a), b / np.linalg.norm(b)))
    np.testing.assert_allclose(both.apply(points), rotation(a).apply(rotation(b).apply(points)), atol=1e-9)


@given(TRIPLES, QUATERNIONS, SCALES)
def test_an_odd_number_of_negative_scales_mirrors(
    shift: FloatArray, q: FloatArray, scale: FloatArray
) -> None:
    assert Transform.from_parts(shift, q, scale).mirrors == (scale.prod() < 0.0)
