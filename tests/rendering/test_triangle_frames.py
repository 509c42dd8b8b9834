"""Barycentric coordinates from rays."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from solver.rendering.projection import PixelRays
from solver.rendering.triangle_frames import frame_records, locate
from solver.types import FloatArray, Points

ONE = np.array([[0, 1, 2]], dtype=np.int32)
HIT = np.zeros((1, 1), dtype=np.int32)
NO = np.zeros(3)


def hit(corners: Points, eye: FloatArray, direction: FloatArray) -> FloatArray:
    """s and t (2,) of the ray on the triangle of `corners` (3, 3)."""
    return np.asarray(locate(HIT, corners, ONE, eye, PixelRays(direction, NO, NO))[0, 0])


@given(st.integers(0, 2**32 - 1), st.floats(-6.0, 6.0))
def test_rays_to_points_of_a_triangle_find_them(seed: int, exponent: float) -> None:
    random = np.random.default_rng(seed)
    size = 10.0**exponent
    corners = size * random.uniform(-1.0, 1.0, (3, 3)) + random.uniform(-1.0, 1.0, 3)
    _, s, t = random.dirichlet(np.ones(3))
    point = corners[0] + s * (corners[1] - corners[0]) + t * (corners[2] - corners[0])
    eye = point + size * random.uniform(0.5, 2.0) * (away := random.normal(size=3)) / np.linalg.norm(away)
    # What is lost: where the triangle is thin, or seen edge on, and to its place far from the origin.
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    thinness = size * size / max(float(np.linalg.norm(normal)), 1e-300)
    edge_on = 1.0 / max(abs(float(normal @ (eye - point))) / float(np.linalg.norm(normal)) / size, 1e-300)
    atol = 1e-14 * thinness * edge_on * (1.0 + 1.0 / size)
    np.testing.assert_allclose(hit(corners, eye, point - eye), (s, t), rtol=0.0, atol=atol)


@given(st.integers(0, 2**32 - 1))
def test_what_misses_is_moved_onto_the_triangle(seed: int) -> None:
    random = np.random.default_rng(seed)
    corners, eye = random.uniform(-1.0, 1.0, (3, 3)), random.uniform(-1.0, 1.0, 3)
    # Now and then along the triangle's plane, or from within it.
    along = [random.normal(size=3), corners[1] - corners[0], np.array([1.0, 0.0, 0.0])][seed % 3]
    s, t = hit(corners, corners[0] if seed % 5 == 0 else eye, along)
    assert min(s, t) >= 0.0
    assert s + t <= 1.0 + 1e-15


def test_triangles_that_are_no_more_than_a_line_give_their_first_corner() -> None:
    for corners in (np.zeros((3, 3)), np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])):
        found = hit(corners, np.array([0.3, 0.1, 5.0]), np.array([0.0, 0.0, -1.0]))
        np.testing.assert_array_equal(found, 0.0)
        assert not frame_records(corners, ONE, np.zeros(1, dtype=np.int32))["matrix"].any()


@given(st.integers(0, 2**32 - 1))
def test_records_hold_planes_and_matrices(seed: int) -> None:
    """A point of the plane, from its two coordinates: the third by the slopes, s and t by the matrix."""
    random = np.random.default_rng(seed)
    corners = random.uniform(-1.0, 1.0, (12, 3))
    triangles = np.arange(12, dtype=np.int32).reshape(4, 3)
    patch = np.array([5, 6, 7, 8], dtype=np.int32)
    records = frame_records(corners, triangles, patch)
    assert records.itemsize == 64
    np.testing.assert_array_equal(records["patch"], patch)
    for record, (a, b, c) in zip(records, corners[triangles], strict=True):
        order = (record["axis"] + np.array([1, 2, 3])) % 3
        np.testing.assert_array_equal(record["origin"], a[order])
        s, t = random.uniform(0.0, 1.0, 2)
        x, y, z = (s * (b - a) + t * (c - a))[order]
        # The axis is that of the longest part of the normal: no slope is above 1.
        assert np.abs(record["slope"]).max() <= 1.0
        np.testing.assert_allclose(z, -record["slope"] @ (x, y), atol=1e-12)
        scale = np.abs(record["matrix"]).max()
        np.testing.assert_allclose(record["matrix"].reshape(2, 2) @ (x, y), (s, t), atol=1e-6 * scale)
