"""Form factors against tables and closed forms, and the laws that they obey."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.transport.exchange import form_factor
from solver.transport.lambert import points_to_polygon
from solver.types import Points
from tests.transport.polygons import (
    SEEDS,
    area_of,
    array,
    case,
    cases,
    convex_polygons,
    cut,
    prisms,
    regular,
    rotation,
)

TOLERANCE = 1e-4
"""The default of `form_factor`, and the least that it promises of pairs that touch."""

NEGLIGIBLE = 1e-9
"""A form factor is at most 1; this share of it is no light."""

PAIRS = cases("polygon-polygon")
SEPARATED = [
    "par_unit_gap_10",
    "par_unit_gap_1000",
    "par_shift_10_10",
    "cornell_light_to_floor",
    "cornell_light_to_right_green",
]
"""Pairs that are averaged over points of the receiver at every tolerance."""


def named(pair: dict[str, Any]) -> str:
    return str(pair["id"])


def error(pair: dict[str, Any], tolerance: float = TOLERANCE) -> float:
    """Relative error of a tabled form factor."""
    return abs(form_factor(array(pair["P1"]), array(pair["P2"]), tolerance) / float(pair["F12"]) - 1.0)


def exchange(first: Points, second: Points) -> float:
    return area_of(first) * form_factor(first, second)


def scale_of(first: Points, second: Points) -> float:
    """What an exchange area may err by and be no light, m2."""
    return NEGLIGIBLE * min(area_of(first), area_of(second))


# --- against tables and closed forms ---


@pytest.mark.parametrize("pair", cases("point-polygon"), ids=named)
def test_point_to_polygon_is_exact(pair: dict[str, Any]) -> None:
    found = points_to_polygon(array([pair["point"]]), array([pair["normal"]]), array(pair["P2"]))[0]
    assert found == pytest.approx(float(pair["F"]), rel=1e-12)


@pytest.mark.parametrize(("a", "b", "c"), [(1, 1, 1), (2, 0.5, 3), (1e-3, 1, 1), (5, 7, 1e-2), (1, 2, 50)])
def test_point_to_parallel_rectangle_is_catalogue_b3(a: float, b: float, c: float) -> None:
    x, y = a / c, b / c
    expected = (
        x / np.hypot(1, x) * np.arctan(y / np.hypot(1, x))
        + y / np.hypot(1, y) * np.arctan(x / np.hypot(1, y))
    ) / (2 * np.pi)
    corners = np.array([[0, 0, c], [0, b, c], [a, b, c], [a, 0, c]], dtype=float)
    found = points_to_polygon(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), corners)[0]
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("h", "b", "c"), [(1, 1, 1), (0.1, 2, 3), (1e-3, 1, 1), (4, 1, 0.5)])
def test_point_to_perpendicular_rectangle_is_catalogue_b4(h: float, b: float, c: float) -> None:
    x, y = h / b, c / b
    expected = (np.arctan(1 / x) - x / np.hypot(x, y) * np.arctan(1 / np.hypot(x, y))) / (2 * np.pi)
    # The wall faces the point; a part below the floor must not count.
    wall = np.array([[0, 0, -1], [0, b, -1], [0, b, c], [0, 0, c]], dtype=float)
    found = points_to_polygon(np.array([[h, 0, 0]], dtype=float), np.array([[0.0, 0.0, 1.0]]), wall)[0]
    assert found == pytest.approx(expected, rel=1e-12)


def test_disc_seen_from_a_point_lies_between_its_polygons() -> None:
    """Catalogue B-13. Polygons in and around a disc send less and more light than it does."""
    expected = float(case("pt_disk_offset")["F12"])
    corners = 2048
    point, up = np.array([[2.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    inner = points_to_polygon(point, up, regular(corners, 1.0, 1.0, down=True))[0]
    outer = points_to_polygon(point, up, regular(corners, 1.0 / np.cos(np.pi / corners), 1.0, down=True))[0]
    assert inner < expected < outer
    assert outer - inner < 1e-5 * expected


@pytest.mark.parametrize(
    ("name", "radius", "gap"), [("disk_disk_1_2_1", 2.0, 1.0), ("disk_disk_close", 1.0, 1e-3)]
)
def test_facing_discs_lie_between_their_polygons(name: str, radius: float, gap: float) -> None:
    """Catalogue C-41."""
    expected = np.pi * float(case(name)["F12"])
    corners = 24
    inner = exchange(regular(corners, 1.0), regular(corners, radius, gap, down=True))
    grown = 1.0 / np.cos(np.pi / corners)
    outer = exchange(regular(corners, grown), regular(corners, grown * radius, gap, down=True))
    assert inner * (1.0 - TOLERANCE) < expected < outer * (1.0 + TOLERANCE)
    assert outer / inner < 1.04


@pytest.mark.parametrize(("name", "tilt"), [("pt_sphere_axis", 0.0), ("pt_sphere_tilt60", 60.0)])
def test_sphere_seen_from_a_point_lies_between_its_polyhedra(name: str, tilt: float) -> None:
    hull = pytest.importorskip("scipy.spatial").ConvexHull
    k = np.arange(1500) + 0.5
    z, angle = 1.0 - 2.0 * k / 1500, np.pi * (1.0 + 5.0**0.5) * k
    ring = np.sqrt(1.0 - z * z)
    found = hull(np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1))
    least = -found.equations[:, 3].max()
    normal = np.array([[np.sin(np.radians(tilt)), 0.0, np.cos(np.radians(tilt))]])
    outward = found.equations[:, :3]
    sums = []
    for radius in (1.0, 1.0 / least):
        faces = found.points[found.simplices] * radius
        turned = np.einsum(
            "ij,ij->i", np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), outward
        )
        faces[turned < 0.0] = faces[turned < 0.0][:, ::-1]
        faces += [0.0, 0.0, 3.0]
        seen = faces[np.einsum("ij,ij->i", outward, faces[:, 0]) < 0.0]
        sums.append(sum(points_to_polygon(np.zeros((1, 3)), normal, face)[0] for face in seen))
    expected = float(case(name)["F12"])
    assert sums[0] < expected < sums[1]
    assert sums[1] / sums[0] < 1.02


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, TOLERANCE])
@pytest.mark.parametrize("pair", PAIRS, ids=named)
def test_form_factor_is_within_its_tolerance(pair: dict[str, Any], tolerance: float) -> None:
    assert error(pair, tolerance) <= tolerance
    swapped = form_factor(array(pair["P2"]), array(pair["P1"]), tolerance)
    assert swapped == pytest.approx(float(pair["F21"]), rel=tolerance)


@pytest.mark.parametrize("name", SEPARATED)
def test_separated_pairs_are_as_exact_as_asked(name: str) -> None:
    for tolerance in (1e-5, 1e-6, 1e-8, 1e-9):
        assert error(case(name), tolerance) <= tolerance


def test_error_falls_with_the_tolerance() -> None:
    worst = [
        max(error(case(name), tolerance) for name in SEPARATED) for tolerance in (1e-2, 1e-4, 1e-6, 1e-9)
    ]
    assert all(after < 0.2 * before for before, after in pairwise(worst))


@pytest.mark.parametrize(
    ("name", "wide", "angle"),
    [("inf_wedge_90", 1.0, 90.0), ("inf_wedge_10", 1.0, 10.0), ("inf_wedge_uneq", 2.0, 60.0)],
)
def test_long_wedges_tend_to_infinite_ones(name: str, wide: float, angle: float) -> None:
    expected = float(case(name)["F12"])
    off = []
    for length in (30.0, 300.0):
        along = np.array([0.0, length, 0.0])
        side = wide * np.array([np.cos(np.radians(angle)), 0.0, np.sin(np.radians(angle))])
        floor = np.array([np.zeros(3), [1, 0, 0], along + np.array([1, 0, 0]), along])
        wall = np.array([np.zeros(3), along, along + side, side])
        off.append(expected - form_factor(floor, wall))
    # The ends lose light in proportion to 1 / length.
    assert off[0] > 0.0
    assert off[1] == pytest.approx(0.1 * off[0], rel=0.2)


def test_what_faces_away_gets_nothing() -> None:
    floor = array(case("par_unit_gap_1")["P1"])
    roof = array(case("par_unit_gap_1")["P2"])
    assert form_factor(floor, roof) > 0.0
    assert form_factor(floor[::-1], roof) == 0.0
    assert form_factor(floor, roof[::-1]) == 0.0
    assert form_factor(floor, floor + np.array([1.0, 0.0, 0.0])) == 0.0, "coplanar"


# --- laws ---


@given(first=convex_polygons(), second=convex_polygons())
def test_reciprocity(first: Points, second: Points) -> None:
    there, back = exchange(first, second), exchange(second, first)
    assert there == pytest.approx(back, rel=2 * TOLERANCE, abs=scale_of(first, second))


@given(polygon=convex_polygons(5), other=convex_polygons(5))
def test_form_factors_are_between_0_and_1(polygon: Points, other: Points) -> None:
    assert 0.0 <= form_factor(polygon, other) <= 1.0 + TOLERANCE


@given(first=convex_polygons(), second=convex_polygons(), share=st.floats(0.1, 0.9))
def test_parts_of_a_source_or_a_receiver_add_up(first: Points, second: Points, share: float) -> None:
    whole = exchange(first, second)
    for parts in (
        sum(exchange(first, piece) for piece in cut(second, share)),
        sum(exchange(piece, second) for piece in cut(first, share)),
    ):
        assert parts == pytest.approx(whole, rel=2 * TOLERANCE, abs=scale_of(first, second))


@given(faces=prisms())
def test_closure(faces: list[Points]) -> None:
    for face in faces:
        assert sum(form_factor(face, other) for other in faces) == pytest.approx(1.0, abs=TOLERANCE)


@given(
    first=convex_polygons(),
    second=convex_polygons(),
    seed=SEEDS,
    shift=st.sampled_from([0.0, 1.0, 30.0]),
    scale=st.sampled_from([1e-3, 1.0, 1e4]),
)
def test_rigid_motion_and_scale_change_nothing(
    first: Points, second: Points, seed: int, shift: float, scale: float
) -> None:
    turn = rotation(seed)

    def moved(polygon: Points) -> Points:
        return np.asarray(scale * (polygon @ turn.T + shift * turn[0]))

    before, after = form_factor(first, second), form_factor(moved(first), moved(second))
    assert after == pytest.approx(before, rel=1e-7, abs=NEGLIGIBLE)


@given(polygon=convex_polygons(), seed=SEEDS)
def test_averaged_points_are_the_polygon(polygon: Points, seed: int) -> None:
    """The form factor of a small receiver is that of its middle."""
    random = np.random.default_rng(seed)
    turn = rotation(seed)
    middle = 3.0 * turn[2] + random.uniform(-1.0, 1.0, 3)
    small = 1e-3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ turn[:2] + middle
    at_middle = points_to_polygon(middle[None], turn[None, 2], polygon)[0]
    assert form_factor(small, polygon) == pytest.approx(at_middle, rel=1e-3, abs=1e-7)


@settings(max_examples=20)
@given(seed=SEEDS)
def test_point_form_factors_of_an_enclosure_sum_to_1(seed: int) -> None:
    random = np.random.default_rng(seed)
    corner = random.uniform(0.2, 3.0, 3)
    low, high = np.zeros(3), corner
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for at, order in ((low, (0, 1, 2, 3)), (high, (3, 2, 1, 0))):
            face = np.tile(at, (4, 1))
            face[:, u], face[:, v] = corner[u] * np.array([0, 1, 1, 0]), corner[v] * np.array([0, 0, 1, 1])
            faces.append(face[list(order)])
    points = random.uniform(0.01, 0.99, (20, 3)) * corner
    normals = random.normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    total = np.sum([points_to_polygon(points, normals, face) for face in faces], axis=0)
    np.testing.assert_allclose(total, 1.0, rtol=1e-12)
