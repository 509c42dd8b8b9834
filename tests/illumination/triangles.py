"""Triangulations under test: how they are made, and the laws that every one of them obeys."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.skeleton import MINIMUM_LENGTH
from solver.illumination.meshing.triangulation import Triangulation
from solver.types import BoolArray, FloatArray, IntArray, Points, Vector
from tests.rendering.fields import Split, build_field, even, polygons

Spot = tuple[float, float]
"""Where on a patch, in (0, 1) x (0, 1)."""

Segment = tuple[int, Spot, Spot]
"""Patch, and both ends."""

CASE_C = polygons(
    [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 1.0, 0.0), (0.0, 1.0, 0.0)],
    [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.7, 0.0, 1.0), (0.7, 0.0, 0.0)],
    [(0.7, 0.0, 0.0), (0.7, 0.0, 1.0), (2.0, 0.0, 0.0)],
)
"""A floor with two walls on one of its edges: corners of one lie inside edges of another [H 3.6, case C]."""

FLOOR, WALL, GABLE = 0, 1, 2

STRAYING = 6.0
"""Discontinuities move by less than this times the minimum length of their patch's widest cell."""


def cells_of(surfaces: Surfaces, split: Split | None = None) -> Cells:
    """The leaves of quadtrees over `surfaces`."""
    return Cells.of(build_field(surfaces, split or even(0)))


def spots() -> st.SearchStrategy[Spot]:
    """Anywhere; where corners of cells are; next to them; on edges."""
    lattice = st.integers(0, 8).map(lambda k: k / 8)
    beside = st.tuples(lattice, st.sampled_from([1e-12, 1e-9, 1e-6, 1e-3, -1e-9])).map(
        lambda pair: min(max(pair[0] + pair[1], 0.0), 1.0)
    )
    anything = st.floats(0.0, 1.0, allow_subnormal=False)
    return st.tuples(*[st.one_of(anything, lattice, beside)] * 2)


def segments(patches: int = 1) -> st.SearchStrategy[list[Segment]]:
    """Some segments, and others that are nearly or exactly along them."""

    def with_shadows(drawn: list[Segment], shift: float) -> list[Segment]:
        beside = [(p, (a[0], min(a[1] + shift, 1.0)), b) for p, a, b in drawn[::2]]
        pieces = [(p, a, (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]))) for p, a, b in drawn[::3]]
        return drawn + beside + pieces

    one = st.tuples(st.integers(0, patches - 1), spots(), spots())
    return st.builds(
        with_shadows, st.lists(one, max_size=12), st.sampled_from([0.0, 1e-13, 1e-9, 1e-4, 1e-3, 2e-3, 1e-2])
    )


def spot_on(surfaces: Surfaces, patch: int, spot: Spot) -> Vector:
    """The point at `spot` of a patch."""
    corners, (u, v) = surfaces.corners[patch], spot
    if surfaces.corner_count[patch] == 3:
        u, v = (u, v) if u + v <= 1.0 else (1.0 - u, 1.0 - v)
        return np.asarray(corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0]))
    weights = np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
    return np.asarray(weights @ corners)


def edges_on(surfaces: Surfaces, segments: list[Segment], jump: BoolArray | None = None) -> ConstraintEdges:
    """Constraint edges, each a set of its own; none jumps unless told."""
    n = len(segments)
    ends = [[spot_on(surfaces, patch, a), spot_on(surfaces, patch, b)] for patch, a, b in segments]
    return ConstraintEdges(
        patch=np.array([patch for patch, _, _ in segments], dtype=np.int32),
        ends=np.array(ends, dtype=np.float64).reshape(n, 2, 3),
        set=np.arange(n, dtype=np.int32),
        jump=np.zeros(n, dtype=np.bool_) if jump is None else jump,
    )


def assert_lawful(
    made: Triangulation, cells: Cells, surfaces: Surfaces, edges: ConstraintEdges, straying: float = STRAYING
) -> None:
    """All laws of a triangulation of `cells` with `edges`."""
    assert len(made.unresolved) == 0
    assert_tiles(made, cells, surfaces)
    assert_conforming(made, surfaces)
    assert_covers(made, cells, edges, straying)
    assert_marks(made, cells, edges, straying)


def areas(made: Triangulation, surfaces: Surfaces) -> FloatArray:
    """(t,) m2, negative for a triangle that is turned over."""
    a, b, c = (made.position[made.triangles[:, k]] for k in range(3))
    return np.asarray(0.5 * np.einsum("ij,ij->i", np.cross(b - a, c - a), surfaces.normal[made.patch]))


def assert_tiles(made: Triangulation, cells: Cells, surfaces: Surfaces) -> None:
    """Every triangle has an area and lies in its cell, and those of a cell add up to it."""
    area = areas(made, surfaces)
    assert np.all(area > 0.0)
    q = cells.corners
    halves = np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]) + np.cross(q[:, 2] - q[:, 0], q[:, 3] - q[:, 0])
    whole = 0.5 * np.einsum("ij,ij->i", halves, surfaces.normal[cells.patch])
    np.testing.assert_allclose(np.bincount(made.cell, area, len(whole)), whole, rtol=1e-9)
    corners = made.position[made.triangles]
    for k in range(4):
        start, end = q[made.cell, k], q[made.cell, (k + 1) % 4]
        normal = surfaces.normal[made.patch]
        inwards = np.cross(normal, end - start)
        height = np.einsum("tki,ti->tk", corners - start[:, None], inwards)
        assert np.all(height >= -1e-9 * np.sqrt(whole[made.cell, None]) * np.abs(inwards).max())
    np.testing.assert_array_equal(made.leaf, cells.leaf[made.cell])
    np.testing.assert_array_equal(made.patch, cells.patch[made.cell])
    np.testing.assert_array_equal(
        made.vertex_patch[made.triangles], np.repeat(made.patch[:, None], 3, axis=1)
    )


def assert_conforming(made: Triangulation, surfaces: Surfaces) -> None:
    """Edges in a patch have the same ends and labels on either side; the others make up its outline."""
    t, k = np.nonzero(made.neighbour >= 0)
    u = made.neighbour[t, k]
    start, end = made.triangles[t, k], made.triangles[t, (k + 1) % 3]
    is_back = (made.triangles[u] == end[:, None]) & (np.roll(made.triangles[u], -1, axis=1) == start[:, None])
    assert np.all(is_back.sum(axis=1) == 1)
    j = is_back.argmax(axis=1)
    np.testing.assert_array_equal(made.neighbour[u, j], t)
    np.testing.assert_array_equal(made.edge_set[u, j], made.edge_set[t, k])
    np.testing.assert_array_equal(made.edge_jump[u, j], made.edge_jump[t, k])
    assert np.all(made.edge_set[made.edge_jump] >= 0)
    t, k = np.nonzero(made.neighbour < 0)
    along = made.position[made.triangles[t, (k + 1) % 3]] - made.position[made.triangles[t, k]]
    length = np.bincount(made.patch[t], np.linalg.norm(along, axis=1), surfaces.patch_count)
    for patch in range(surfaces.patch_count):
        outline = surfaces.corners[patch, : surfaces.corner_count[patch]]
        perimeter = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1).sum()
        np.testing.assert_allclose(length[patch], perimeter, rtol=1e-9)


def distances(points: Points, start: Points, end: Points) -> FloatArray:
    """(n, m) distance of each point from each line segment."""
    along = end - start
    square = np.maximum(np.einsum("ij,ij->i", along, along), np.finfo(float).tiny)
    t = np.clip(np.einsum("nmi,mi->nm", points[:, None] - start, along) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(points[:, None] - start - t[:, :, None] * along, axis=2))


def slack(cells: Cells, patch: int, straying: float) -> float:
    """Metres by which discontinuities of a patch may move."""
    widest = np.ptp(cells.corners[cells.patch == patch], axis=1).max()
    return float(straying * MINIMUM_LENGTH * widest)


def marked(made: Triangulation, patch: int, jumps_only: bool = False) -> tuple[Points, Points, IntArray]:
    """Start, end and set of the triangle edges of a patch that are on discontinuities."""
    chosen = (made.edge_set >= 0) & (made.patch == patch)[:, None]
    t, k = np.nonzero(chosen & made.edge_jump if jumps_only else chosen)
    start, end = made.triangles[t, k], made.triangles[t, (k + 1) % 3]
    return made.position[start], made.position[end], made.edge_set[t, k]


def assert_covers(made: Triangulation, cells: Cells, edges: ConstraintEdges, straying: float) -> None:
    """Every constraint edge, but for those that are too short, runs along marked edges of triangles."""
    for e in range(len(edges)):
        room = slack(cells, edges.patch[e], straying)
        start, end = edges.ends[e]
        if np.linalg.norm(end - start) <= 2.0 * room:
            continue
        points = start + np.linspace(0.0, 1.0, 33)[:, None] * (end - start)
        a, b, _ = marked(made, edges.patch[e], bool(edges.jump[e]))
        assert len(a) > 0
        assert distances(points, a, b).min(axis=1).max() <= room


def assert_marks(made: Triangulation, cells: Cells, edges: ConstraintEdges, straying: float) -> None:
    """What is marked with a set lies on an edge of that set."""
    for patch in np.unique(made.patch[np.any(made.edge_set >= 0, axis=1)]):
        a, b, sets = marked(made, patch)
        for k in np.unique(sets):
            mine = (edges.set == k) & (edges.patch == patch)
            assert mine.any()
            middles = 0.5 * (a + b)[sets == k]
            far = distances(middles, edges.ends[mine, 0], edges.ends[mine, 1]).min(axis=1)
            assert far.max() <= slack(cells, patch, straying)


def gaps(made: Triangulation, size: float) -> int:
    """How many vertices lie inside a border edge, of any patch, and are missing there."""
    t, k = np.nonzero(made.neighbour < 0)
    first, last = made.triangles[t, k], made.triangles[t, (k + 1) % 3]
    start, along = made.position[first], made.position[last] - made.position[first]
    length = np.linalg.norm(along, axis=1)
    near = 1e-11 * size
    found = 0
    for vertex in made.position[np.unique(first)]:
        at = np.einsum("ij,ij->i", vertex - start, along) / length
        off = np.linalg.norm(vertex - start - (at / length)[:, None] * along, axis=1)
        found += int(np.count_nonzero((at > near) & (length - at > near) & (off < near)))
    return found
