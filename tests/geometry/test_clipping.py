"""Clipping by a plane: the part above, in order, with its area; nothing invented."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.geometry.clipping import clip_to_plane
from solver.geometry.faces import newell_normal
from solver.types import FloatArray, Points

TOLERANCE = 1e-9
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


def clip(polygon: Points, normal: FloatArray, offset: float, tolerance: float = TOLERANCE) -> Points:
    out = np.full((len(polygon) + 1, 3), np.nan)
    count = clip_to_plane(polygon, len(polygon), normal, offset, tolerance, out)
    assert np.all(np.isnan(out[count:]))
    return out[:count]


def area(polygon: Points) -> FloatArray:
    return 0.5 * newell_normal(polygon[None])[0] if len(polygon) else np.zeros(3)


@st.composite
def convex_polygons(draw: st.DrawFn) -> Points:
    """Corners on a circle in space, counter-clockwise about z before it is turned."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    angles = np.sort(random.uniform(0, 2 * np.pi, draw(st.integers(3, 9))))
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    return np.ascontiguousarray(
        np.c_[np.cos(angles), np.sin(angles), np.zeros(len(angles))] @ turn + random.normal(size=3)
    )


@st.composite
def planes(draw: st.DrawFn) -> tuple[FloatArray, float]:
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    normal = random.normal(size=3)
    return normal / np.linalg.norm(normal), float(random.normal())


@given(convex_polygons(), planes())
def test_the_two_sides_add_up(polygon: Points, plane: tuple[FloatArray, float]) -> None:
    normal, offset = plane
    above, below = clip(polygon, normal, offset), clip(polygon, -normal, -offset)
    np.testing.assert_allclose(area(above) + area(below), area(polygon), atol=1e-8)
    for part, sign in ((above, 1.0), (below, -1.0)):
        assert np.all(sign * (part @ normal - offset) >= -1.0001 * TOLERANCE)
        assert len(part) != 1 and len(part) != 2
        # Turned as before.
        assert area(part) @ area(polygon) >= -1e-12


@given(convex_polygons(), planes())
def test_clipping_twice_changes_nothing(polygon: Points, plane: tuple[FloatArray, float]) -> None:
    once = clip(polygon, *plane)
    if len(once):
        np.testing.assert_array_equal(clip(once, *plane), once)


@given(convex_polygons(), planes(), st.integers(0, 8))
def test_where_it_starts_does_not_matter(
    polygon: Points, plane: tuple[FloatArray, float], shift: int
) -> None:
    first, second = clip(polygon, *plane), clip(np.roll(polygon, shift, axis=0), *plane)
    assert len(first) == len(second)
    np.testing.assert_allclose(area(first), area(second), atol=1e-12)


@given(convex_polygons(), planes())
def test_corners_above_stay_bit_for_bit(polygon: Points, plane: tuple[FloatArray, float]) -> None:
    normal, offset = plane
    kept = {tuple(point) for point in clip(polygon, normal, offset)}
    above = polygon @ normal - offset > 2.0 * TOLERANCE
    assert {tuple(point) for point in polygon[above]} <= kept


@pytest.mark.parametrize(
    ("offset", "expected"),
    [(-1.0, 4), (0.0, 4), (0.5, 4), (1.0, 0), (2.0, 0), (-1e-12, 4), (1e-12, 4), (1.0 - 1e-12, 0)],
)
def test_axis_parallel_cuts(offset: float, expected: int) -> None:
    """Corners within the tolerance of the plane stay; what only touches it from below is nothing."""
    part = clip(SQUARE, np.array([1.0, 0.0, 0.0]), offset)
    assert len(part) == expected
    if expected:
        assert area(part)[2] == pytest.approx(1.0 - max(offset, 0.0), abs=1e-9)


def test_a_cut_through_two_corners_makes_no_new_ones() -> None:
    part = clip(SQUARE, np.array([1.0, -1.0, 0.0]) * np.sqrt(0.5), 0.0)
    np.testing.assert_array_equal(part, SQUARE[:3])


def test_a_cut_through_one_corner_makes_one_new_one() -> None:
    normal = np.array([2.0, -1.0, 0.0]) / np.sqrt(5.0)
    part = clip(SQUARE, normal, 0.0)
    np.testing.assert_allclose(part, np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0.5, 1, 0]]), atol=1e-15)


def test_one_corner_cut_off_gives_one_corner_more() -> None:
    normal = -np.array([1.0, 1.0, 0.0]) * np.sqrt(0.5)
    part = clip(SQUARE, normal, -1.5 * np.sqrt(0.5))
    assert len(part) == 5
    assert area(part)[2] == pytest.approx(0.875)


def test_a_polygon_in_the_plane_is_nothing() -> None:
    assert len(clip(SQUARE, np.array([0.0, 0.0, 1.0]), 0.0)) == 0
