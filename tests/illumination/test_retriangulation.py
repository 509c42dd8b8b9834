"""What a triangulation keeps of the one before: all but the cells that changed, as it would be made anew."""

from __future__ import annotations

from collections.abc import Generator
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.splitting import split_cells
from solver.illumination.meshing.triangulation import Triangulation, triangulate, triangulate_in_steps
from tests.illumination.fine import drain
from tests.illumination.triangles import (
    CASE_C,
    FLOOR,
    WALL,
    Segment,
    assert_lawful,
    cells_of,
    edges_on,
    gaps,
    segments,
)
from tests.rendering.fields import SQUARE, even, polygons, surfaces_of, uneven

GRID = surfaces_of(polygons(SQUARE))
"""Cut into eight by eight cells below: corners at eighths."""


def assert_equal(one: Triangulation, other: Triangulation) -> None:
    names = ["position", "vertex_patch", "triangles", "patch", "cell", "leaf", "edge_set", "edge_jump"]
    for name in [*names, "neighbour", "vertex_start", "triangle_start", "unresolved"]:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)


def shapes(made: Triangulation, cells: Cells) -> dict[bytes, bytes]:
    """The corners of the triangles of each cell, by the corners of the cell."""
    corners = made.position[made.triangles]
    return {cells.corners[k].tobytes(): corners[made.cell == k].tobytes() for k in range(len(cells.patch))}


def kept(first: Triangulation, before: Cells, made: Triangulation, cells: Cells) -> int:
    """How many cells of `made` have the triangles that they had."""
    known, now = shapes(first, before), shapes(made, cells)
    return sum(known.get(corners) == triangles for corners, triangles in now.items())


@given(data=st.data(), seed=st.integers(0, 10_000), lines=segments(3))
@settings(max_examples=60, deadline=None)
def test_what_changes_gives_what_a_fresh_start_gives(
    data: st.DataObject, seed: int, lines: list[Segment]
) -> None:
    """Whatever part of the cells and edges is replaced."""
    surfaces = surfaces_of(CASE_C)
    before, after = cells_of(surfaces, uneven(seed, 3)), cells_of(surfaces, uneven(seed + 1, 3))
    known = edges_on(surfaces, lines)
    first = triangulate(before, surfaces, known)
    changed = data.draw(st.sets(st.integers(0, 2)))
    cells = mixed(before, after, changed)
    chosen = [i for i in range(len(lines)) if data.draw(st.integers(0, 5)) > 0]
    edges = known.take(np.array(chosen, dtype=np.int32))
    assert_equal(triangulate(cells, surfaces, edges, first), triangulate(cells, surfaces, edges))


def mixed(before: Cells, after: Cells, changed: set[int]) -> Cells:
    """Cells of `after` on the patches that are `changed`, of `before` on the others; with other leaves."""
    old = ~np.isin(before.patch, list(changed))
    new = ~old if after is before else np.isin(after.patch, list(changed))
    total = int(old.sum() + new.sum())
    return Cells(
        np.concatenate([before.corners[old], after.corners[new]]),
        np.concatenate([before.corner_count[old], after.corner_count[new]]),
        np.concatenate([before.patch[old], after.patch[new]]),
        np.arange(100, 100 + total, dtype=np.int32),
    )


@given(seed=st.integers(0, 10_000), lines=segments(3), middles=st.booleans())
@settings(max_examples=25, deadline=None)
def test_a_sequence_of_edits_gives_what_a_fresh_start_gives(
    seed: int, lines: list[Segment], middles: bool
) -> None:
    """Edges come and go, cells are split; each triangulation follows from the last. Grids have many ties."""
    surfaces = surfaces_of(CASE_C)
    random = np.random.default_rng(seed)
    for k in range(1, 6):
        lines = [*lines, (FLOOR, (k / 7, 0.1), (k / 7, 0.9)), (FLOOR, (0.1, k / 7), (0.9, k / 7))]
    cells, all_edges = cells_of(surfaces, uneven(seed, 2)), edges_on(surfaces, lines)
    active = random.random(len(lines)) < 0.5
    made: Triangulation | None = None
    for _ in range(5):
        active ^= random.random(len(lines)) < random.choice([0.0, 0.2])
        cells = split_cells(cells, random.random(len(cells.patch)) < random.choice([0.0, 0.1]))
        edges = all_edges.take(np.flatnonzero(active).astype(np.int32))
        made = triangulate(cells, surfaces, edges, made, middles)
        assert_equal(made, triangulate(cells, surfaces, edges, None, middles))
    assert made is not None
    assert_lawful(made, cells, surfaces, edges)
    assert gaps(made, surfaces.size) == 0


@pytest.mark.parametrize(
    ("name", "lines", "changed"),
    [
        ("nothing", [], 0),
        ("within a cell", [(0, (0.26, 0.27), (0.35, 0.31))], 1),
        ("from a cell's middle to its side", [(0, (0.3, 0.3), (0.375, 0.31))], 2),
        ("across a side", [(0, (0.3, 0.3), (0.45, 0.31))], 2),
        ("to a corner", [(0, (0.3, 0.3), (0.375, 0.375))], 1),
        ("along a side", [(0, (0.375, 0.25), (0.375, 0.375))], 0),
        ("part of a side", [(0, (0.375, 0.28), (0.375, 0.33))], 2),
        ("through three cells, to the side of a fourth", [(0, (0.26, 0.3), (0.625, 0.31))], 4),
        ("two cells far apart", [(0, (0.01, 0.02), (0.1, 0.1)), (0, (0.9, 0.95), (0.97, 0.9))], 2),
    ],
)
def test_only_what_an_edge_touches_is_rebuilt(name: str, lines: list[Segment], changed: int) -> None:
    cells = cells_of(GRID, even(3))
    first = triangulate(cells, GRID, edges_on(GRID, []))
    assert first.rebuilt == 64
    edges = edges_on(GRID, lines)
    made = triangulate(cells, GRID, edges, first)
    assert made.rebuilt == changed
    assert kept(first, cells, made, cells) == 64 - changed
    assert_lawful(made, cells, GRID, edges)
    # Gone again, all is as it was.
    again = triangulate(cells, GRID, edges_on(GRID, []), made)
    assert again.rebuilt == changed
    assert_equal(again, first)


def test_what_ends_on_a_seam_is_also_the_affair_of_the_other_side() -> None:
    surfaces = surfaces_of(CASE_C)
    cells = cells_of(surfaces, even(2))
    first = triangulate(cells, surfaces, edges_on(surfaces, []))
    assert first.rebuilt == 48
    # Onto the seam with the wall, within one of its cells and one of the floor's.
    made = triangulate(cells, surfaces, edges_on(surfaces, [(FLOOR, (0.03, 0.0), (0.1, 0.2))]), first)
    assert made.rebuilt == 2
    changed = shapes(made, cells).items() - shapes(first, cells).items()
    patches = {
        int(cells.patch[k]) for k in range(48) if any(cells.corners[k].tobytes() == c for c, _ in changed)
    }
    assert patches == {FLOOR, WALL}


def around(cells: Cells, x: float, y: float) -> int:
    """The cell that a point of the grid lies in."""
    low, high = cells.corners[:, :, :2].min(axis=1), cells.corners[:, :, :2].max(axis=1)
    return int(np.flatnonzero(np.all((low < (x, y)) & ((x, y) < high), axis=1))[0])


@pytest.mark.parametrize(
    ("spot", "changed"), [((0.3, 0.3), 4 + 4), ((0.01, 0.3), 4 + 3), ((0.01, 0.01), 4 + 2)]
)
def test_a_split_rebuilds_the_parts_and_the_neighbours(spot: tuple[float, float], changed: int) -> None:
    """Cells keep their triangles though those behind the split one have other numbers."""
    cells, edges = cells_of(GRID, even(3)), edges_on(GRID, [(0, (0.5, 0.6), (0.95, 0.95))])
    first = triangulate(cells, GRID, edges)
    finer = split_cells(cells, np.arange(64) == around(cells, *spot))
    made = triangulate(finer, GRID, edges, first)
    assert made.rebuilt == changed
    assert kept(first, cells, made, finer) == len(finer.patch) - changed
    assert_equal(made, triangulate(finer, GRID, edges))
    # The neighbours have a vertex more, so that a second split of a part is between the parts alone.
    finest = split_cells(finer, np.arange(67) == around(finer, spot[0] + 0.03, spot[1] + 0.03))
    assert triangulate(finest, GRID, edges, made).rebuilt < 4 + 4 + 1


def test_sets_and_jumps_alone_rebuild_nothing_and_are_told() -> None:
    cells, edges = cells_of(GRID, even(2)), edges_on(GRID, [(0, (0.1, 0.2), (0.8, 0.7))])
    first = triangulate(cells, GRID, edges)
    other = ConstraintEdges(edges.patch, edges.ends, edges.set + np.int32(5), ~edges.jump)
    second = triangulate(cells, GRID, other, first)
    assert second.rebuilt == 0
    assert set(np.unique(second.edge_set)) == {-1, 5}
    assert np.array_equal(second.edge_jump, first.edge_set == 0)
    assert_equal(second, triangulate(cells, GRID, other))


def test_other_numbers_of_patches_keep_their_triangles() -> None:
    """Cells are known by where they are."""
    square, shifted = polygons(SQUARE), polygons([(x + 3.0, y, z) for x, y, z in SQUARE], name="b")
    one, both = surfaces_of(square), surfaces_of(shifted, square)
    first = triangulate(cells_of(one, even(2)), one, edges_on(one, [(0, (0.1, 0.2), (0.8, 0.7))]))
    cells, edges = cells_of(both, even(2)), edges_on(both, [(1, (0.1, 0.2), (0.8, 0.7))])
    made = triangulate(cells, both, edges, first)
    assert made.rebuilt == 16
    assert_equal(made, triangulate(cells, both, edges))


def test_work_comes_in_steps_and_ends_with_the_same() -> None:
    surfaces = surfaces_of(CASE_C)
    cells = cells_of(surfaces, uneven(5, 3))
    edges = edges_on(surfaces, [(FLOOR, (0.1, 0.2), (0.9, 0.7)), (WALL, (0.2, 0.2), (0.3, 0.9))])
    steps = 0

    def counted() -> Generator[None, None, Triangulation]:
        nonlocal steps
        work = triangulate_in_steps(cells, surfaces, edges)
        while True:
            try:
                next(work)
            except StopIteration as end:
                return cast("Triangulation", end.value)
            steps += 1
            yield

    assert_equal(drain(counted()), triangulate(cells, surfaces, edges))
    assert steps > 10
