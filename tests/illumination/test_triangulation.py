"""Laws of triangulations: they tile, conform, follow discontinuities, and stay where nothing has changed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.geometry.scene import Mesh, SceneObject
from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.skeleton import MINIMUM_LENGTH
from solver.illumination.meshing.triangulation import Triangulation, triangulate
from solver.transport.elements import ElementTree
from solver.types import FloatArray
from tests.illumination.triangles import (
    CASE_C,
    FLOOR,
    WALL,
    Segment,
    areas,
    assert_conforming,
    assert_lawful,
    cells_of,
    edges_on,
    gaps,
    marked,
    segments,
)
from tests.rendering.fields import SQUARE, Split, even, polygons, surfaces_of, towards, uneven

SHAPES = {
    "square": SQUARE,
    "triangle": [(0.0, 0.0, 0.0), (1.3, 0.1, 0.0), (0.2, 0.9, 0.0)],
    "skew": [(0.0, 0.0, 0.0), (1.0, 0.1, 0.0), (1.4, 1.1, 0.0), (-0.2, 0.7, 0.0)],
    "sliver": [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0), (100.0, 0.01, 0.0), (0.0, 0.01, 0.0)],
    "wedge": [(0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (10.0, 0.001, 0.0)],
}


def shape(name: str) -> Surfaces:
    return surfaces_of(polygons(SHAPES[name]))


def made_of(surfaces: Surfaces, split: Split, segments: list[Segment]) -> Triangulation:
    """The triangulation, which is lawful."""
    cells, edges = cells_of(surfaces, split), edges_on(surfaces, segments)
    made = triangulate(cells, surfaces, edges)
    assert_lawful(made, cells, surfaces, edges)
    return made


@given(
    name=st.sampled_from(sorted(SHAPES)),
    seed=st.integers(0, 10_000),
    depth=st.integers(0, 4),
    lines=segments(),
    middles=st.booleans(),
)
@settings(max_examples=150, deadline=None)
def test_any_patch_is_lawful(name: str, seed: int, depth: int, lines: list[Segment], middles: bool) -> None:
    surfaces = shape(name)
    cells, edges = cells_of(surfaces, uneven(seed, depth)), edges_on(surfaces, lines)
    assert_lawful(triangulate(cells, surfaces, edges, middles=middles), cells, surfaces, edges)


@given(seed=st.integers(0, 10_000), depth=st.integers(0, 3), lines=segments(3), two_sided=st.booleans())
@settings(max_examples=60, deadline=None)
def test_seams_have_no_gaps(seed: int, depth: int, lines: list[Segment], two_sided: bool) -> None:
    surfaces = surfaces_of(SceneObject("c", CASE_C.mesh, polygons(SQUARE, two_sided=two_sided).material))
    cells, edges = cells_of(surfaces, uneven(seed, depth)), edges_on(surfaces, lines)
    made = triangulate(cells, surfaces, edges)
    assert_lawful(made, cells, surfaces, edges)
    assert gaps(made, surfaces.size) == 0


def test_a_plain_square_is_two_triangles() -> None:
    surfaces = shape("square")
    made = made_of(surfaces, even(3), [])
    assert len(made.triangles) == 2 * 64
    assert len(made.position) == 81
    assert np.all(made.edge_set == -1)


def test_a_diagonal_is_the_better_one() -> None:
    """No angle that faces the diagonal of a cell is as obtuse as those that faced the other."""
    made = made_of(surfaces_of(polygons([(0, 0, 0), (3, 0, 0), (1, 1, 0), (0, 1, 0)])), even(0), [])
    t, k = np.argwhere(made.neighbour >= 0)[0]
    ends = made.position[made.triangles[t, [k, (k + 1) % 3]]]
    assert {tuple(end) for end in ends} == {(0.0, 0.0, 0.0), (1.0, 1.0, 0.0)}


def test_middles_are_for_cells_that_several_neighbours_touch() -> None:
    surfaces = shape("square")
    cells, none = cells_of(surfaces, uneven(3, 5)), ConstraintEdges.none()
    with_middles = triangulate(cells, surfaces, none)
    without = triangulate(cells, surfaces, none, middles=False)
    added = len(with_middles.position) - len(without.position)
    assert added > 0
    # A fan from the middle has two triangles more than one without.
    assert len(with_middles.triangles) - len(without.triangles) == 2 * added
    assert thinnest(with_middles) > thinnest(without)


def thinnest(made: Triangulation) -> float:
    """The least ratio of height to longest edge."""
    corners = made.position[made.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return float((doubled / longest**2).min())


def test_neighbours_of_many_levels_share_their_vertices() -> None:
    made = made_of(shape("square"), towards((0.5, 0.5, 0.0), 12), [(0, (0.1, 0.2), (0.9, 0.81))])
    assert areas(made, shape("square")).min() > 0.0


def test_elements_of_a_solve_are_cells() -> None:
    """Elements at least twice as long as wide are split in two: other trees than the tests' own."""
    surfaces = surfaces_of(polygons([(0, 0, 0), (5, 0, 0), (5, 1, 0), (0, 1, 0)]), polygons(SQUARE, name="b"))
    tree = ElementTree(surfaces)
    random = np.random.default_rng(5)
    for _ in range(5):
        tree.split(random.permutation(tree.leaves)[: 1 + len(tree.leaves) // 2].astype(np.int32))
    leaves = tree.leaves
    cells = Cells(tree.corners[leaves], tree.corner_count[leaves], tree.patch[leaves], leaves)
    edges = edges_on(surfaces, [(0, (0.05, 0.1), (0.93, 0.8)), (1, (0.3, 1.0), (1.0, 0.35))])
    made = triangulate(cells, surfaces, edges)
    assert_lawful(made, cells, surfaces, edges)
    assert gaps(made, surfaces.size) == 0


@pytest.mark.parametrize("shift", [0.0, 1e-15, 1e-12, 1e-9, 1e-6])
def test_an_end_beside_a_vertex_is_that_vertex(shift: float) -> None:
    made = made_of(shape("square"), even(1), [(0, (0.5 + shift, 0.5 + 0.3 * shift), (0.1, 0.2))])
    start, end, _ = marked(made, 0)
    assert np.array([0.5, 0.5, 0.0]).tolist() in np.concatenate([start, end]).tolist()
    off = np.abs(made.position[:, :2] - 0.5)
    assert not np.any((off > 0.0) & (off < 1e-5))


@pytest.mark.parametrize("shift", [1e-15, 1e-12, 1e-9, 1e-6])
def test_an_end_beside_an_edge_is_on_it(shift: float) -> None:
    """On either side of it, and beside the border of the patch."""
    ends: list[Segment] = [
        (0, (0.5 - shift, 0.3), (0.1, 0.2)),
        (0, (0.5 + shift, 0.8), (0.9, 0.7)),
        (0, (0.2, shift), (0.3, 0.6)),
    ]
    made = made_of(shape("square"), even(1), ends)
    for y in (0.3, 0.8):
        assert made.position[np.isclose(made.position[:, 1], y, rtol=1e-12), 0].tolist() == [0.5]
    assert [0.2, 0.0, 0.0] in made.position.tolist()


def test_an_edge_along_a_border_marks_it_and_moves_nothing() -> None:
    for height in (0.0, 1e-12, 1e-5):
        made = made_of(shape("square"), even(2), [(0, (0.0, height), (1.0, height))])
        start, end, _ = marked(made, 0)
        assert np.all(start[:, 1] == 0.0) and np.all(end[:, 1] == 0.0)
        assert np.abs(end - start).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("angle", [1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12])
def test_nearly_parallel_edges_cross(angle: float) -> None:
    lines: list[Segment] = [
        (0, (0.0, 0.4 + 0.01 * k), (1.0, 0.4 + 0.01 * k + (k % 2 - 0.5) * angle)) for k in range(5)
    ]
    lines += [(0, (0.0, 0.4 + 0.01 * k + 0.5 * angle), (1.0, 0.4 + 0.01 * k)) for k in range(5)]
    made_of(shape("square"), even(1), lines)


def test_edges_that_cross_beside_an_edge_of_cells_cross_on_it() -> None:
    """Both graze the side of their cell and cross within its reach: the neighbour gets the vertex too."""
    made = made_of(shape("square"), even(1), [(0, (0.0, 0.502), (0.4, 0.5)), (0, (0.5, 0.502), (0.3, 0.5))])
    on_side = made.position[made.position[:, 1] == 0.5, 0]
    np.testing.assert_allclose(np.sort(on_side), [0.0, 0.3, 1 / 3, 0.4, 0.5, 1.0], atol=1e-9)


@pytest.mark.parametrize("aspect", [1e-5, 1e-7, 1e-9])
def test_needles_are_tiled_whatever_crosses_them(aspect: float) -> None:
    """Where only rounding tells what is flat, areas still add up to what rounding allows."""
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0] * 7.0
    corners = (
        np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.9, aspect, 0.0), (0.0, 0.6 * aspect, 0.0)]) @ turn
    )
    surfaces = surfaces_of(polygons([(x, y, z) for x, y, z in corners.tolist()]))
    cells = cells_of(surfaces, uneven(2, 3))
    edges = edges_on(
        surfaces, [(0, (0.1, 0.2), (0.9, 0.7)), (0, (0.0, 0.9), (0.8, 0.1)), (0, (0.3, 0.0), (0.3, 1.0))]
    )
    made = triangulate(cells, surfaces, edges)
    assert len(made.unresolved) == 0
    assert_conforming(made, surfaces)
    whole = np.abs(areas(made, surfaces)).sum()
    assert whole == pytest.approx(surfaces.area[0], rel=1e-14 / aspect + 1e-9)


def test_hundreds_of_collinear_edges_are_one_line() -> None:
    random = np.random.default_rng(1)
    start, end = random.random((2, 300))
    pieces: list[Segment] = [
        (0, (float(a), 0.2 + 0.5 * float(a)), (float(b), 0.2 + 0.5 * float(b)))
        for a, b in zip(start, end, strict=True)
    ]
    made = made_of(shape("square"), even(0), pieces)
    a, b, _ = marked(made, 0)
    assert np.linalg.norm(b - a, axis=1).sum() / 2 == pytest.approx(np.ptp([start, end]) * np.hypot(1, 0.5))


def test_a_star_meets_in_one_vertex() -> None:
    """Forty lines through a point that rounding keeps from being one."""
    turns = np.linspace(0.0, np.pi, 40, endpoint=False)
    rays: list[Segment] = [
        (
            0,
            (0.5 + 0.45 * np.cos(a), 0.5 + 0.45 * np.sin(a)),
            (0.5 - 0.45 * np.cos(a), 0.5 - 0.45 * np.sin(a)),
        )
        for a in turns
    ]
    made = made_of(shape("square"), even(0), rays)
    assert len(made.position) == 4 + 80 + 1


def test_a_grid_of_lines_in_one_cell() -> None:
    lines: list[Segment] = []
    for k in range(1, 15):
        lines += [(0, (k / 15, 0.0), (k / 15, 1.0)), (0, (0.0, k / 15), (1.0, k / 15))]
    made = made_of(shape("skew"), even(0), lines)
    assert len(made.position) == 16 * 16
    assert len(made.triangles) == 2 * 15 * 15


def test_edges_too_short_to_mesh_are_left_out() -> None:
    """At half the minimum length, relative to their cell, nothing is added; at ten times it, something is."""
    surfaces = shape("square")
    short: Segment = (0, (0.3, 0.3), (0.3 + 0.5 * MINIMUM_LENGTH, 0.3))
    long: Segment = (0, (0.3, 0.3), (0.3 + 10.0 * MINIMUM_LENGTH, 0.3))
    assert len(made_of(surfaces, even(0), [short]).position) == 4
    assert len(made_of(surfaces, even(0), [long]).position) == 6
    assert len(made_of(surfaces, even(0), [(0, (0.3, 0.3), (0.3, 0.3))]).position) == 4


def test_a_jump_is_told_where_a_kink_runs_along_it() -> None:
    surfaces = shape("square")
    lines: list[Segment] = [(0, (0.1, 0.3), (0.9, 0.3)), (0, (0.2, 0.3), (0.7, 0.3))]
    edges = edges_on(surfaces, lines, np.array([False, True]))
    made = triangulate(cells_of(surfaces), surfaces, edges)
    a, b, sets = marked(made, 0)
    middle = 0.5 * (a + b)[:, 0]
    np.testing.assert_array_equal(sets == 1, (middle > 0.2) & (middle < 0.7))
    np.testing.assert_array_equal(made.edge_jump, made.edge_set == 1)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_scenes_of_any_size_anywhere_are_alike(scale: float, offset: float) -> None:
    def placed(scale: float, offset: FloatArray | float, turn: FloatArray) -> Triangulation:
        vertices = scale * CASE_C.mesh.vertices @ turn.T + offset
        surfaces = surfaces_of(SceneObject("c", Mesh(vertices, CASE_C.mesh.faces), CASE_C.material))
        lines: list[Segment] = [
            (FLOOR, (0.11, 0.0), (0.63, 0.42)),
            (FLOOR, (0.2, 0.9), (0.3, 0.2)),
            (WALL, (0.4, 1.0), (0.3, 0.33)),
        ]
        cells, edges = cells_of(surfaces, uneven(8, 4)), edges_on(surfaces, lines)
        made = triangulate(cells, surfaces, edges)
        assert_lawful(made, cells, surfaces, edges)
        assert gaps(made, surfaces.size) == 0
        return made

    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    home, away = placed(1.0, 0.0, np.eye(3)), placed(scale, offset, turn)
    np.testing.assert_allclose(away.position, scale * home.position @ turn.T + offset, atol=1e-9 * scale)


def test_discontinuities_end_at_a_seam_on_either_side() -> None:
    """Both patches have a vertex there, in the same place to the last bit; ends that nearly meet are one."""
    surfaces = surfaces_of(CASE_C)
    # On the seam, where v of the floor and u of the wall are 0: the wall has 0.7 m of the floor's 2 m.
    lines: list[Segment] = [
        (FLOOR, (0.111, 0.0), (0.3, 0.6)),
        (WALL, (0.0, 0.5), (0.2, 1.0)),
        (WALL, (0.0, 0.222 / 0.7 + 1e-6), (0.5, 0.2)),
    ]
    for split in (even(0), uneven(2, 3), towards((0.7, 0.0, 0.0), 5)):
        made = made_of(surfaces, split, lines)
        assert gaps(made, surfaces.size) == 0
        on_seam = np.all(made.position[:, 1:] == 0.0, axis=1) & (made.position[:, 0] <= 0.7)
        floor, wall = (
            np.sort(made.position[on_seam & (made.vertex_patch == patch), 0]) for patch in (FLOOR, WALL)
        )
        np.testing.assert_array_equal(floor, wall)
        for x in (0.222, 0.35):
            assert np.count_nonzero(np.abs(floor - x) < 1e-5) == 1


def test_a_board_that_is_seen_from_both_sides_has_the_same_border_on_both() -> None:
    surfaces = surfaces_of(polygons(SQUARE, two_sided=True))
    made = made_of(surfaces, even(0), [(0, (0.3, 0.0), (0.6, 0.5))])
    assert gaps(made, surfaces.size) == 0
    assert [0.3, 0.0, 0.0] in made.position[made.vertex_patch == 1].tolist()


def test_gaps_are_found_where_they_are() -> None:
    """The check for gaps can fail: patches that know nothing of each other have some."""
    surfaces = surfaces_of(CASE_C)
    loose = surfaces_of(*(polygons(corners_of(surfaces, k), name=str(k)) for k in range(3)))
    apart = [surfaces_of(polygons(corners_of(surfaces, k))) for k in range(3)]
    parts = [triangulate(cells_of(one, even(k)), one, ConstraintEdges.none()) for k, one in enumerate(apart)]
    first = np.cumsum([0] + [len(part.position) for part in parts])
    together = replace(
        parts[0],
        position=np.concatenate([part.position for part in parts]),
        triangles=np.concatenate([part.triangles + n for part, n in zip(parts, first, strict=False)]),
        neighbour=np.concatenate([part.neighbour for part in parts]),
    )
    assert gaps(together, loose.size) > 0


def corners_of(surfaces: Surfaces, patch: int) -> list[tuple[float, float, float]]:
    return [(x, y, z) for x, y, z in surfaces.corners[patch, : surfaces.corner_count[patch]].tolist()]


def test_a_quadrilateral_that_is_not_quite_flat_is_tiled() -> None:
    surfaces = surfaces_of(polygons([(0, 0, 0), (1, 0, 5e-6), (1, 1, 0), (0, 1, 5e-6)]))
    cells, edges = cells_of(surfaces, uneven(4, 3)), edges_on(surfaces, [(0, (0.1, 0.15), (0.8, 0.93))])
    assert_lawful(triangulate(cells, surfaces, edges), cells, surfaces, edges)


def test_a_scene_without_cells_has_no_triangles() -> None:
    surfaces = shape("square")
    nothing = Cells(np.empty((0, 4, 3)), *(np.empty(0, dtype=np.int32) for _ in range(3)))
    made = triangulate(nothing, surfaces, ConstraintEdges.none())
    assert made.triangles.shape == (0, 3) and made.position.shape == (0, 3)
    assert triangulate(nothing, surfaces, ConstraintEdges.none(), made).rebuilt == 0
    assert len(triangulate(nothing, surfaces_of(), ConstraintEdges.none()).triangles) == 0


@pytest.mark.parametrize("name", ["patch", "ends"])
def test_edges_that_are_nowhere_are_refused(name: str) -> None:
    surfaces = shape("square")
    edges = edges_on(surfaces, [(0, (0.1, 0.1), (0.2, 0.7))])
    wrong: Any = {"patch": edges.patch + np.int32(1), "ends": edges.ends * np.nan}[name]
    with pytest.raises(ValueError, match="constraint edges must"):
        triangulate(cells_of(surfaces), surfaces, replace(edges, **{name: wrong}))
