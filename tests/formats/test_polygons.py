"""Triangles in one plane become polygons of the same surface."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.formats.polygons import merge_triangles, weld
from solver.geometry.faces import newell_normal
from solver.types import Points

Faces = list[tuple[int, ...]]


def grid(across: int, down: int, height: Any = lambda x, y: 0.0) -> tuple[Points, Faces]:
    """Triangles over cells of one metre, two each."""
    vertices = np.array(
        [[x, y, height(x, y)] for y, x in itertools.product(range(down + 1), range(across + 1))], dtype=float
    )
    faces: Faces = []
    for x, y in itertools.product(range(across), range(down)):
        a = y * (across + 1) + x
        b, c, d = a + 1, a + across + 2, a + across + 1
        faces += [(a, b, c), (a, c, d)]
    return vertices, faces


def vector_area(vertices: Points, faces: Faces) -> Points:
    """(3,) twice the area, along the normals."""
    return np.asarray(np.sum([newell_normal(vertices[list(face)][None])[0] for face in faces], axis=0))


def test_a_flat_grid_is_one_quadrilateral() -> None:
    vertices, faces = grid(7, 5)
    (merged,) = merge_triangles(vertices, faces)
    assert len(merged) == 4
    assert {tuple(vertices[corner][:2]) for corner in merged} == {(0, 0), (7, 0), (7, 5), (0, 5)}
    assert newell_normal(vertices[list(merged)][None])[0] == pytest.approx([0, 0, 70])


def test_a_folded_grid_is_a_quadrilateral_a_fold() -> None:
    vertices, faces = grid(4, 3, lambda x, y: abs(x - 2))
    merged = merge_triangles(vertices, faces)
    assert sorted(map(len, merged)) == [4, 4]


def test_a_flat_piece_with_a_hole_is_paired() -> None:
    vertices, faces = grid(3, 3)
    holed = faces[:8] + faces[10:]
    merged = merge_triangles(vertices, holed)
    assert sorted(map(len, merged)) == [4] * 8
    assert vector_area(vertices, merged) == pytest.approx([0, 0, 16])


def test_faces_back_to_back_stay_apart() -> None:
    vertices, faces = grid(1, 1)
    both = faces + [face[::-1] for face in faces]
    merged = merge_triangles(vertices, both)
    assert vector_area(vertices, merged) == pytest.approx([0, 0, 0])
    assert len(merged) in {2, 4}


def test_curved_surfaces_stay_as_they_are() -> None:
    vertices, faces = grid(6, 6, lambda x, y: 0.05 * x * y)
    assert len(merge_triangles(vertices, faces)) == len(faces)


@given(st.lists(st.booleans(), min_size=24, max_size=24), st.integers(0, 2**32 - 1))
def test_the_surface_stays_the_same(chosen: list[bool], seed: int) -> None:
    """Whatever triangles of a flat grid there are, in whatever order and place: their area is kept."""
    vertices, faces = grid(4, 3)
    rng = np.random.default_rng(seed)
    kept = [faces[k] for k in rng.permutation(24) if chosen[k]]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    placed = vertices @ turn.T + rng.normal(size=3)
    merged = merge_triangles(placed, kept)
    assert vector_area(placed, merged) == pytest.approx(vector_area(placed, kept), abs=1e-9)
    assert len(merged) <= len(kept)
    flat = sum(float(np.linalg.norm(newell_normal(placed[list(face)][None])[0])) for face in merged)
    assert flat == pytest.approx(len(kept), abs=1e-9), "no polygon is folded upon itself"


def test_welding_drops_what_nobody_uses() -> None:
    vertices = np.array([[9, 9, 9], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -0.0], [1, 0, 0]], dtype=float)
    points, faces = weld(vertices, [(1, 2, 3), (4, 5, 3), (1, 4, 2), (1, 1, 2)])
    assert len(points) == 3
    assert faces == [faces[0], faces[0]]
