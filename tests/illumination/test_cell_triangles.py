"""What a cell becomes depends on the cell alone: whatever it is triangulated with, and however often."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.illumination.meshing import cell_triangles, delaunay
from solver.illumination.meshing.cell_lines import CellLines
from solver.illumination.meshing.cell_triangles import TriangulationError, triangulate_cells
from solver.illumination.meshing.cells import Cells
from solver.illumination.meshing.delaunay import LibraryError, constrained_triangles
from solver.illumination.meshing.linework import Linework
from solver.illumination.meshing.triangulation import triangulate
from solver.illumination.meshing.unchanged import find_unchanged
from solver.types import Int64Array, IntArray
from tests.illumination.fine import drain
from tests.illumination.triangles import CASE_C, Segment, cells_of, edges_on, segments
from tests.rendering.fields import SQUARE, even, polygons, surfaces_of, uneven

SQUARES = surfaces_of(polygons(SQUARE))


def linework(lines: list[Segment], seed: int = 3, depth: int = 3) -> Linework:
    surfaces = surfaces_of(CASE_C)
    cells = cells_of(surfaces, uneven(seed, depth))
    return triangulate(cells, surfaces, edges_on(surfaces, lines)).linework


def cut_cells(lines: Linework) -> CellLines:
    """The cells of a linework that have lines in them."""
    return CellLines.of(lines, np.flatnonzero(np.diff(lines.edge_start)))


def grid() -> CellLines:
    """A cell of sixteen squares, each with its corners on a circle."""
    lines: list[Segment] = []
    for k in range(1, 4):
        lines += [(0, (k / 4, 0.0), (k / 4, 1.0)), (0, (0.0, k / 4), (1.0, k / 4))]
    return cut_cells(triangulate(cells_of(SQUARES), SQUARES, edges_on(SQUARES, lines)).linework)


def by_cell(found: tuple[IntArray, Int64Array], count: int) -> list[IntArray]:
    triangles, row = found
    assert np.all(np.diff(row) >= 0)
    return [triangles[row == k] for k in range(count)]


@given(lines=segments(3), seed=st.integers(0, 100), order=st.randoms(use_true_random=False))
@settings(max_examples=30, deadline=None)
def test_company_changes_nothing(lines: list[Segment], seed: int, order: Random) -> None:
    """Alone, all together, in another order, and beside many copies of a cell full of ties."""
    drawn = cut_cells(linework(lines, seed))
    together = by_cell(constrained_triangles(drawn), len(drawn))
    shuffled = list(range(len(drawn)))
    order.shuffle(shuffled)
    other = by_cell(constrained_triangles(drawn.take(np.array(shuffled, dtype=np.int64))), len(drawn))
    for k, at in enumerate(shuffled):
        np.testing.assert_array_equal(other[k], together[at])
        np.testing.assert_array_equal(constrained_triangles(drawn.take(np.array([at])))[0], together[at])


def test_ties_are_cut_alike_wherever_a_cell_lies() -> None:
    one = grid()
    alone = constrained_triangles(one)[0]
    many = by_cell(constrained_triangles(one.take(np.zeros(97, dtype=np.int64))), 97)
    for triangles in many:
        np.testing.assert_array_equal(triangles, alone)


def test_more_cells_than_fit_in_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = cut_cells(linework([(0, (0.1, 0.2), (0.9, 0.7)), (0, (0.0, 0.9), (0.8, 0.1))]))
    whole = constrained_triangles(lines)
    monkeypatch.setattr(delaunay, "_MOST_CELLS", 3)
    assert len(lines) > 6
    for mine, theirs in zip(constrained_triangles(lines), whole, strict=True):
        np.testing.assert_array_equal(mine, theirs)


@given(lines=segments(3), seed=st.integers(0, 100))
@settings(max_examples=30, deadline=None)
def test_triangles_are_delaunay_but_for_their_lines(lines: list[Segment], seed: int) -> None:
    """Each inner edge without a line faces angles of 180 degrees in all, at most, in its cell's frame."""
    drawn = cut_cells(linework(lines, seed))
    triangles, row = constrained_triangles(drawn)
    for k in range(len(drawn)):
        places = slice(drawn.start[k], drawn.start[k + 1])
        axes = drawn.axes[k] / np.sum(drawn.axes[k] ** 2, axis=1, keepdims=True)
        xy = (drawn.position[places] - drawn.center[k]) @ axes.T
        fixed = {
            frozenset(ends) for ends in drawn.edge[drawn.edge_start[k] : drawn.edge_start[k + 1]].tolist()
        }
        angle: dict[frozenset[int], list[float]] = {}
        for triangle in triangles[row == k].tolist():
            for i in range(3):
                a, b, c = (triangle[(i + j) % 3] for j in range(3))
                u, v = xy[a] - xy[c], xy[b] - xy[c]
                angle.setdefault(frozenset((a, b)), []).append(
                    float(np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v))
                )
        facing = [sum(both) for edge, both in angle.items() if len(both) == 2 and edge not in fixed]
        assert max(facing, default=0.0) <= np.pi + 1e-6


def test_a_cell_that_the_library_refuses_is_named() -> None:
    """Two patches of four cells, each with two lines inside; those of one cell made to cross."""
    surfaces = surfaces_of(polygons(SQUARE, [(x + 3.0, y, z) for x, y, z in SQUARE]))
    inside: list[Segment] = [
        (patch, (x + 0.1, y + k), (x + 0.3, y + k))
        for patch in (0, 1)
        for x in (0.0, 0.5)
        for y in (0.0, 0.5)
        for k in (0.1, 0.2)
    ]
    lines = triangulate(cells_of(surfaces, even(1)), surfaces, edges_on(surfaces, inside)).linework
    edge = lines.edge.copy()
    edge[lines.edge_start[6] : lines.edge_start[7]] = [(0, 2), (1, 3)]
    crossed = replace(lines, edge=edge)
    with pytest.raises(LibraryError, match="cell 6") as caught:
        constrained_triangles(CellLines.of(crossed, np.arange(8)))
    assert caught.value.row == 6
    with pytest.raises(TriangulationError, match="patch 1") as told:
        drain(triangulate_cells(crossed))
    assert told.value.patch == 1


def test_batches_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches are as large as time allows: any are the same."""

    class Pace:
        size = 1

        def batches(self, costs: Int64Array) -> Iterator[slice]:
            for first in range(0, len(costs), self.size):
                yield slice(first, min(first + self.size, len(costs)))

    lines = linework([(0, (0.1, 0.2), (0.9, 0.7)), (0, (0.0, 0.9), (0.8, 0.1)), (1, (0.1, 0.4), (0.9, 0.7))])
    whole, fresh = drain(triangulate_cells(lines))
    np.testing.assert_array_equal(fresh, np.arange(len(lines.corner_count)))
    monkeypatch.setattr(cell_triangles, "Pace", Pace)
    for Pace.size in (1, 7, 1000):
        parts, _ = drain(triangulate_cells(lines))
        np.testing.assert_array_equal(parts.start, whole.start)
        np.testing.assert_array_equal(parts.corners, whole.corners)


def test_cells_are_known_by_their_corners_wherever_they_stand() -> None:
    """In any order, and among others; one bit of one node makes another of them."""
    surfaces = surfaces_of(CASE_C)
    cells = cells_of(surfaces, uneven(3, 3))
    edges = edges_on(surfaces, [(0, (0.1, 0.2), (0.9, 0.7))])
    order = np.random.default_rng(1).permutation(len(cells.patch))
    turned = Cells(cells.corners[order], cells.corner_count[order], cells.patch[order], cells.leaf[order])
    one, other = (triangulate(which, surfaces, edges).linework for which in (cells, turned))
    found = drain(find_unchanged(other, one))
    assert sorted(found.tolist()) == list(range(len(order)))
    np.testing.assert_array_equal(other.center, one.center[found])
    moved = one.position.copy()
    node = int(one.node[one.start[5]])
    moved[node, 1] = np.nextafter(moved[node, 1], 9.0)
    touched = [k for k in range(len(order)) if node in one.node[one.start[k] : one.start[k + 1]]]
    found = drain(find_unchanged(replace(one, position=moved), one))
    np.testing.assert_array_equal(np.flatnonzero(found < 0), touched)
    same = np.flatnonzero(found >= 0)
    np.testing.assert_array_equal(found[same], same)


def test_the_two_sides_of_a_board_are_not_mistaken_for_each_other() -> None:
    surfaces = surfaces_of(polygons(SQUARE, two_sided=True))
    lines = triangulate(cells_of(surfaces, even(1)), surfaces, edges_on(surfaces, [])).linework
    found = drain(find_unchanged(lines, lines))
    np.testing.assert_array_equal(found, np.arange(8))
    turned = replace(lines, normal=-lines.normal)
    assert np.all(drain(find_unchanged(turned, lines)) < 0)
