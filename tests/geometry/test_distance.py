"""The nearest point of a polygon, against a search and along the normal."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.geometry.distance import nearest_point
from solver.types import FloatArray

SQUARE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
UP = np.array([0.0, 0.0, 1.0])
coordinate = st.floats(-5.0, 5.0)


def ask(x: FloatArray, corners: FloatArray, count: int) -> tuple[float, FloatArray]:
    nearest = np.empty(3)
    return nearest_point(x[0], x[1], x[2], corners, count, UP, nearest), nearest


@given(coordinate, coordinate, coordinate)
def test_a_rectangle_is_nearest_where_coordinates_are_clamped(x: float, y: float, z: float) -> None:
    point = np.array([x, y, z])
    clamped = np.clip(point, [0.0, 0.0, 0.0], [2.0, 1.0, 0.0])
    square, nearest = ask(point, SQUARE, 4)
    np.testing.assert_allclose(nearest, clamped, atol=1e-12)
    assert square == pytest.approx(float(np.sum((point - clamped) ** 2)), abs=1e-12)


@given(coordinate, coordinate, coordinate)
def test_no_point_of_a_triangle_is_nearer(x: float, y: float, z: float) -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [3.0, 0.5, 0.0], [1.0, 2.0, 0.0], [1.0, 2.0, 0.0]])
    point = np.array([x, y, z])
    square, nearest = ask(point, triangle, 3)
    u = np.linspace(0.0, 1.0, 41)
    a, b = (w.ravel() for w in np.meshgrid(u, u))
    inside = a + b <= 1.0
    others = triangle[0] + a[inside, None] * triangle[1] + b[inside, None] * triangle[2]
    assert square <= np.sum((others - point) ** 2, axis=1).min() + 1e-12
    assert square == pytest.approx(float(np.sum((nearest - point) ** 2)), abs=1e-12)
