"""Laws of the hierarchy: it holds every polygon once, in boxes that hold them, in depth-first order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.types import Corners, IntArray
from solver.visibility.bvh import LEAF_SIZE, Hierarchy, build_hierarchy, walk_hierarchy


def corners_of(n: int, seed: int) -> Corners:
    random = np.random.default_rng(seed)
    return random.uniform(-1, 1, (n, 1, 3)) + random.uniform(-0.1, 0.1, (n, 4, 3))


def subtree(tree: Hierarchy, node: int) -> slice:
    return slice(node, int(tree.skip[node]))


def polygons_below(tree: Hierarchy, node: int) -> IntArray:
    leaves = [k for k in range(*subtree(tree, node).indices(len(tree.skip))) if tree.first[k] >= 0]
    return np.concatenate([tree.order[tree.first[k] : tree.first[k] + tree.count[k]] for k in leaves])


@given(st.integers(1, 200), st.integers(0, 2**32 - 1))
def test_laws(n: int, seed: int) -> None:
    corners = corners_of(n, seed)
    members = np.flatnonzero(np.random.default_rng(seed).random(n) < 0.8).astype(np.int32)
    tree = build_hierarchy(corners, members)
    np.testing.assert_array_equal(np.sort(tree.order), members)
    if len(members) == 0:
        assert len(tree.skip) == 0
        return
    assert np.all(tree.skip > np.arange(len(tree.skip)))
    assert tree.skip[0] == len(tree.skip)
    leaf = tree.first >= 0
    assert np.all(tree.skip[leaf] == np.flatnonzero(leaf) + 1)
    assert np.all(tree.count[leaf] <= LEAF_SIZE) and np.all(tree.count[leaf] >= 1)
    for node in range(len(tree.skip)):
        below = corners[polygons_below(tree, node)].reshape(-1, 3)
        # Boxes are tight.
        np.testing.assert_array_equal(tree.low[node], below.min(axis=0))
        np.testing.assert_array_equal(tree.high[node], below.max(axis=0))
        if not leaf[node]:
            # Two children one after the other make up the node.
            left, right = node + 1, int(tree.skip[node + 1])
            assert tree.skip[right] == tree.skip[node]
            sizes = len(polygons_below(tree, left)), len(polygons_below(tree, right))
            assert abs(sizes[0] - sizes[1]) <= 1


@pytest.mark.parametrize("n", [1, LEAF_SIZE, LEAF_SIZE + 1, 5000])
def test_polygons_in_one_place_are_split_all_the_same(n: int) -> None:
    tree = build_hierarchy(np.zeros((n, 4, 3)), np.arange(n, dtype=np.int32))
    np.testing.assert_array_equal(np.sort(tree.order), np.arange(n))
    assert tree.count.max() <= LEAF_SIZE
    assert tree.count.sum() == n


@given(st.integers(1, 100), st.integers(0, 2**32 - 1), st.integers(0, 6))
def test_walk_finds_all_that_reach_above_every_plane(n: int, seed: int, plane_count: int) -> None:
    """A superset of the polygons, and nothing below a box that lies outside of a plane."""
    corners = corners_of(n, seed)
    tree = build_hierarchy(corners, np.arange(n, dtype=np.int32))
    random = np.random.default_rng(seed + 1)
    planes = random.normal(size=(plane_count, 4))
    planes[:, :3] /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    out = np.empty(n, dtype=np.int32)
    found = walk_hierarchy(
        tree.low, tree.high, tree.skip, tree.first, tree.count, tree.order, planes, plane_count, 0.0, out
    )
    heights = corners @ planes[:, :3].T - planes[:, 3]
    reaching = (heights.max(axis=1) > 0.0).all(axis=1)
    assert set(np.flatnonzero(reaching)) <= set(out[:found].tolist())
    assert len(set(out[:found].tolist())) == found
    if plane_count == 0:
        assert found == n
