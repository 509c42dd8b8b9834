"""The element hierarchy: children tile their parents, and moments are what quadrature says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from solver.geometry.scene import Mesh, SceneObject
from solver.transport.elements import ElementTree, plane_axes
from solver.types import Points
from tests.pathtracing.worlds import material, world
from tests.transport.polygons import area_of, convex_polygons
from tests.transport.solving import leaves_of, shelf, solved, state_of

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


def tree_of(*polygons: Points) -> ElementTree:
    objects = [
        SceneObject(f"p{k}", Mesh(polygon, (tuple(range(len(polygon))),)), material(0.5))
        for k, polygon in enumerate(polygons)
    ]
    return ElementTree(world(*objects).surfaces)


def grow(tree: ElementTree, levels: int) -> None:
    for _ in range(levels):
        tree.split(tree.leaves)


def corners_of(tree: ElementTree, element: int) -> Points:
    return tree.corners[element, : tree.corner_count[element]]


def quadrature(
    tree: ElementTree, element: int
) -> tuple[Points, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """Points (m, 3) and weights (m,) that integrate quadratic functions over an element exactly."""
    corners = corners_of(tree, element)
    points, weights = [], []
    for k in range(1, len(corners) - 1):
        triangle = corners[[0, k, k + 1]]
        points.append(0.5 * (triangle + np.roll(triangle, 1, axis=0)))
        weights.append(np.full(3, area_of(triangle) / 3.0))
    return np.concatenate(points), np.concatenate(weights)


@settings(max_examples=40)
@given(polygon=convex_polygons())
def test_children_tile_their_parent(polygon: Points) -> None:
    tree = tree_of(polygon)
    grow(tree, 3)
    normal = tree.patch_normal[0]
    for parent in np.flatnonzero(tree.child >= 0).tolist():
        first, count = tree.child[parent], tree.child_count[parent]
        children = range(first, first + count)
        assert sum(tree.area[c] for c in children) == pytest.approx(tree.area[parent], rel=1e-14)
        # Same areas, same side, none outside: tiles.
        outline = corners_of(tree, parent)
        for c in children:
            assert tree.parent[c] == parent
            assert tree.area[c] == pytest.approx(area_of(corners_of(tree, c)), rel=1e-9)
            edges = np.roll(outline, -1, axis=0) - outline
            for corner in corners_of(tree, c):
                side = np.cross(edges, corner - outline) @ normal
                assert np.all(side >= -1e-12)
            spokes = np.cross(
                corners_of(tree, c)[1] - corners_of(tree, c)[0],
                corners_of(tree, c)[2] - corners_of(tree, c)[0],
            )
            assert spokes @ normal > 0.0, "turned over"


@pytest.mark.parametrize(
    ("polygon", "children"),
    [
        (SQUARE, 4),
        (SQUARE[:3], 4),
        (SQUARE * [1.9, 1.0, 1.0], 4),
        (SQUARE * [2.0, 1.0, 1.0], 2),
        (SQUARE * [1.0, 30.0, 1.0], 2),
    ],
)
def test_number_of_children(polygon: Points, children: int) -> None:
    tree = tree_of(polygon)
    grow(tree, 1)
    assert tree.child_count[0] == children
    assert len(tree) == 1 + children


def test_slivers_get_no_longer() -> None:
    tree = tree_of(SQUARE * [1000.0, 1.0, 1.0])
    grow(tree, 10)
    sides = np.linalg.norm(np.diff(tree.corners[tree.leaves], axis=1), axis=2)
    assert np.max(sides[:, 0] / sides[:, 1]) < 2.0
    assert np.min(sides[:, 0] / sides[:, 1]) > 0.5


def test_shared_vertices_are_bit_identical() -> None:
    """Elements that refinement made unequal meet in vertices or in T-junctions of the very same numbers."""
    random = np.random.default_rng(3)
    quad = np.array([[0.1, 0.2, 0.3], [1.3, 0.1, 0.35], [1.1, 1.7, 0.9], [0.2, 1.1, 0.7]])
    quad[3] = quad[0] + 0.9 * (quad[2] - quad[1])
    tree = tree_of(quad)
    for _ in range(5):
        leaves = tree.leaves
        tree.split(leaves[random.random(len(leaves)) < 0.5])
    vertices = np.concatenate([corners_of(tree, e) for e in tree.leaves])
    exact = np.unique(vertices, axis=0)
    gap = 1e-9
    rounded = np.unique(np.round(vertices / gap).astype(np.int64), axis=0)
    assert len(exact) == len(rounded)
    assert len(exact) < 0.5 * len(vertices)


@settings(max_examples=40)
@given(polygon=convex_polygons())
def test_moments_are_those_of_quadrature(polygon: Points) -> None:
    tree = tree_of(polygon)
    grow(tree, 2)
    for e in range(len(tree)):
        points, weights = quadrature(tree, e)
        area = weights.sum()
        centroid = weights @ points / area
        size = np.sqrt(area)
        np.testing.assert_allclose(tree.centroid[e], centroid, atol=1e-10 * size)
        x = (points - centroid) @ tree.axes[tree.patch[e]].T
        expected = [weights @ (x[:, i] * x[:, j]) / area for i, j in ((0, 0), (0, 1), (1, 1))]
        np.testing.assert_allclose(tree.moment[e], expected, atol=1e-9 * area)
        if tree.parent[e] >= 0:
            step = (centroid - tree.centroid[tree.parent[e]]) @ tree.axes[tree.patch[e]].T
            np.testing.assert_allclose(tree.offset[e], step, atol=1e-9 * size)
        else:
            assert not tree.offset[e].any()


@given(polygon=convex_polygons())
def test_axes_are_right_handed_with_the_normal(polygon: Points) -> None:
    normal = tree_of(polygon).patch_normal
    u, v = plane_axes(normal)[0]
    np.testing.assert_allclose(np.cross(u, v), normal[0], atol=1e-14)
    np.testing.assert_allclose([u @ u, v @ v, u @ v], [1.0, 1.0, 0.0], atol=1e-14)


def test_solved_leaves_tile_their_patches() -> None:
    solver = solved(shelf())
    state, field = state_of(solver), solver.field()
    assert len(field.area) == leaves_of(state).sum() > 100
    areas = np.bincount(field.patch, field.area, solver.surfaces.patch_count)
    np.testing.assert_allclose(areas, solver.surfaces.area, rtol=1e-12)
    assert np.all(state.tree.parent < np.arange(len(state.tree))), "children lie behind their parents"
