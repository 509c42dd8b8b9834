"""Faces into patches: area and facing are kept, whatever the polygon is like."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver import tolerances
from solver.geometry.faces import FacePatches, newell_normal, split_faces
from solver.types import FloatArray, Points


def split(polygon: Points | list[list[float]], scene_size: float | None = None) -> FacePatches:
    vertices = np.array(polygon, dtype=float)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0))) if scene_size is None else scene_size
    return split_faces(vertices, (tuple(range(len(vertices))),), size)


def vector_areas(patches: FacePatches) -> FloatArray:
    """(p, 3) normals as long as the patches' areas."""
    c = patches.corners
    return 0.5 * np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1])


def flat(points: list[tuple[float, float]] | FloatArray) -> Points:
    return np.asarray(np.c_[np.array(points, dtype=float), np.zeros(len(points))])


def shoelace(polygon: Points) -> float:
    x, y = polygon[:, 0], polygon[:, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def turned(polygon: Points, seed: int) -> Points:
    """Somewhere in space, at another size."""
    random = np.random.default_rng(seed)
    q = np.linalg.qr(random.normal(size=(3, 3)))[0]
    q *= np.sign(np.linalg.det(q))
    return np.asarray(10.0 ** random.uniform(-3, 3) * (polygon @ q.T + random.normal(size=3)))


def area_scale(polygon: Points, placed: Points) -> float:
    """Factor of the areas between two similar polygons, by their perimeters."""
    lengths = [np.linalg.norm(p - np.roll(p, 1, axis=0), axis=1).sum() for p in (polygon, placed)]
    return float((lengths[1] / lengths[0]) ** 2)


@st.composite
def star_polygons(draw: st.DrawFn) -> Points:
    """Simple polygons about a point, mostly concave, counter-clockwise in the plane z = 0."""
    radii = draw(st.lists(st.sampled_from([0.05, 0.2, 0.5, 1.0]), min_size=3, max_size=24))
    angles = 2.0 * np.pi * np.arange(len(radii)) / len(radii)
    return flat(np.array(radii)[:, None] * np.c_[np.cos(angles), np.sin(angles)])


def spiral(turns: int) -> Points:
    """A corridor of width 0.4 that winds inward."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 12 * turns + 1)
    radius = 1.0 + 0.9 * angle / (2.0 * np.pi)
    way = np.c_[np.cos(angle), np.sin(angle)]
    return flat(np.concatenate([(radius + 0.4)[:, None] * way, (radius[:, None] * way)[::-1]]))


L_SHAPE = flat([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])
COMB = flat(
    [
        (0, 0),
        (7, 0),
        (7, 3),
        (6, 3),
        (6, 1),
        (5, 1),
        (5, 3),
        (4, 3),
        (4, 1),
        (3, 1),
        (3, 3),
        (2, 3),
        (2, 1),
        (1, 1),
        (1, 3),
        (0, 3),
    ]
)
SEAMED = flat([(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)])
"""A square with a square hole, cut in by a seam."""


# --- area and facing ---


@given(star_polygons(), st.integers(0, 2**32 - 1))
def test_area_and_facing_are_kept(polygon: Points, seed: int) -> None:
    placed = turned(polygon, seed)
    patches = split(placed)
    assert patches.dropped == patches.unfaithful == ()
    vectors = vector_areas(patches)
    whole = 0.5 * newell_normal(placed[None])[0]
    np.testing.assert_allclose(vectors.sum(axis=0), whole, atol=1e-9 * float(np.linalg.norm(whole)))
    # All on one side: as areas add up, none overlaps or is turned over.
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(np.linalg.norm(whole), rel=1e-9)
    assert np.linalg.norm(whole) == pytest.approx(shoelace(polygon) * area_scale(polygon, placed), rel=1e-6)


@pytest.mark.parametrize(
    ("polygon", "area"),
    [(L_SHAPE, 3.0), (COMB, 15.0), (SEAMED, 15.0), (spiral(3), None)],
    ids=["L", "comb", "seam", "spiral"],
)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_hard_polygons(polygon: Points, area: float | None, seed: int) -> None:
    expected = shoelace(polygon) if area is None else area
    assert shoelace(polygon) == pytest.approx(expected)
    placed = turned(polygon, seed)
    patches = split(placed)
    assert patches.unfaithful == ()
    total = np.linalg.norm(vector_areas(patches), axis=1).sum()
    assert total == pytest.approx(expected * area_scale(polygon, placed), rel=1e-9)
    assert np.all(patches.corner_count == 3)


def test_triangles_and_convex_quadrilaterals_pass_as_they_are() -> None:
    triangle, quad = flat([(0, 0), (1, 0), (0, 1)]), flat([(0, 0), (2, 0), (1.5, 1), (0, 1)])
    (corners,) = split(triangle).corners
    np.testing.assert_array_equal(corners, triangle[[0, 1, 2, 2]])
    patches = split(quad)
    np.testing.assert_array_equal(patches.corners[0], quad)
    assert patches.corner_count.tolist() == [4]


def test_arrow_is_two_triangles_that_meet_in_its_notch() -> None:
    arrow = flat([(0, 0), (2, 0), (0.2, 0.2), (0, 2)])
    patches = split(arrow)
    assert patches.corner_count.tolist() == [3, 3]
    assert all((corners == arrow[2]).all(axis=1).any() for corners in patches.corners)


def test_quad_with_a_corner_on_its_side_is_not_kept_as_a_quad() -> None:
    """Three corners in line: as a quadrilateral its map would fold."""
    patches = split(flat([(0, 0), (1, 0), (2, 0), (0, 2)]))
    assert patches.corner_count.tolist() == [3] * len(patches.corner_count)
    assert np.linalg.norm(vector_areas(patches), axis=1).sum() == pytest.approx(2.0)


# --- faces that are not planar ---


@given(st.floats(0.01, 1.0), st.integers(0, 2**32 - 1))
def test_bent_quadrilateral_becomes_two_triangles_of_its_corners(bend: float, seed: int) -> None:
    bent = flat([(0, 0), (1, 0), (1, 1), (0, 1)])
    bent[2, 2] = bend
    placed = turned(bent, seed)
    patches = split(placed)
    assert patches.corner_count.tolist() == [3, 3]
    used = {tuple(point) for corners in patches.corners for point in corners}
    assert used == {tuple(point) for point in placed}
    # The vector area of a surface depends on its rim alone.
    np.testing.assert_allclose(
        vector_areas(patches).sum(axis=0),
        0.5 * newell_normal(placed[None])[0],
        atol=1e-9 * np.abs(placed).max() ** 2,
    )
    assert np.all(vector_areas(patches) @ newell_normal(placed[None])[0] > 0.0)


@pytest.mark.parametrize(
    ("height", "kept"), [(0.3 * tolerances.PLANARITY, True), (30 * tolerances.PLANARITY, False)]
)
def test_planarity_is_relative_to_the_face(height: float, kept: bool) -> None:
    for size in (1e-3, 1.0, 1e4):
        quad = size * flat([(0, 0), (1, 0), (1, 1), (0, 1)])
        quad[2, 2] = size * height
        assert (split(quad).corner_count.tolist() == [4]) == kept


def test_larger_faces_that_are_not_planar_are_split_as_seen_along_their_normal() -> None:
    """A hexagon with two corners lifted: every triangle faces up, and their shadow is the hexagon."""
    angles = np.arange(6) * np.pi / 3.0
    hexagon = flat(np.c_[np.cos(angles), np.sin(angles)])
    hexagon[[1, 4], 2] = 0.3
    patches = split(hexagon)
    assert len(patches.corners) == 4
    vectors = vector_areas(patches)
    assert np.all(vectors[:, 2] > 0.0)
    assert vectors[:, 2].sum() == pytest.approx(shoelace(hexagon))


# --- what is not acceptable, and what just is ---


@pytest.mark.parametrize(
    "polygon",
    [
        [[0, 0, 0], [1, 0, 0], [2, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [0, 0, 0]],
        [[1, 2, 3]] * 4,
        [[0, 0, 0], [1, 1, 0], [2, 2, 0], [3, 3, 0], [1.5, 1.5, 0]],
        [[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0]],
        [[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]],
    ],
    ids=["line", "there-and-back", "point", "long-line", "two-spikes", "symmetric-bow-tie"],
)
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e6])
def test_faces_without_area_are_dropped(polygon: list[list[float]], scale: float) -> None:
    patches = split(scale * np.array(polygon, dtype=float), scene_size=4.0 * scale)
    assert patches.dropped == (0,)
    assert len(patches.corners) == len(patches.face) == 0


def test_faces_smaller_than_rounding_of_the_scene_are_dropped() -> None:
    speck = 1e-9 * flat([(0, 0), (1, 0), (0, 1)])
    assert split(speck, scene_size=1.0).dropped == ()
    assert split(speck, scene_size=1e6).dropped == (0,)


@pytest.mark.parametrize("width", [1e-3, 1e-6, 1e-8])
@pytest.mark.parametrize("corners", [3, 4, 5])
def test_slivers_are_kept(width: float, corners: int) -> None:
    shapes = {
        3: [(0, 0), (1, 0), (0.5, width)],
        4: [(0, 0), (1, 0), (1, width), (0, width)],
        5: [(0, 0), (0.5, 0), (1, 0), (1, width), (0, width)],
    }
    sliver = flat(shapes[corners])  # type: ignore[arg-type]
    patches = split(sliver)
    assert patches.dropped == ()
    assert np.linalg.norm(vector_areas(patches), axis=1).sum() == pytest.approx(shoelace(sliver), rel=1e-6)


def test_lopsided_bow_tie_is_told_of() -> None:
    patches = split(flat([(0, 0), (3, 0), (0, 1), (1, 2)]))
    assert patches.dropped == ()
    assert patches.unfaithful == (0,)
    assert np.all(np.linalg.norm(vector_areas(patches), axis=1) > 0.0)


def test_repeated_corner_leaves_the_rest() -> None:
    patches = split(flat([(0, 0), (2, 0), (2, 0), (2, 2), (0, 2)]))
    assert np.linalg.norm(vector_areas(patches), axis=1).sum() == pytest.approx(4.0)


# --- many faces at once ---


@given(st.lists(star_polygons(), min_size=1, max_size=6))
def test_patches_of_many_faces_are_those_of_each(polygons: list[Points]) -> None:
    vertices = np.concatenate(polygons)
    starts = np.cumsum([0] + [len(polygon) for polygon in polygons])
    faces = tuple(tuple(range(a, b)) for a, b in pairwise(starts.tolist()))
    together = split_faces(vertices, faces, 2.0)
    assert np.all(np.diff(together.face) >= 0)
    for index, polygon in enumerate(polygons):
        alone = split(polygon, 2.0)
        mine = together.face == index
        np.testing.assert_array_equal(together.corners[mine], alone.corners)
        np.testing.assert_array_equal(together.corner_count[mine], alone.corner_count)


def test_no_faces() -> None:
    patches = split_faces(np.empty((0, 3)), (), 1.0)
    assert patches.corners.shape == (0, 4, 3)
    assert len(patches.face) == len(patches.corner_count) == 0


@given(star_polygons(), st.floats(1e2, 1e6))
def test_newell_normal_keeps_its_digits_far_from_the_origin(polygon: Points, distance: float) -> None:
    """Up to what the coordinates themselves have lost."""
    area = 0.5 * newell_normal((polygon + distance)[None])[0]
    lost = 10.0 * np.finfo(float).eps * distance * len(polygon)
    np.testing.assert_allclose(area, [0.0, 0.0, shoelace(polygon)], atol=lost)
