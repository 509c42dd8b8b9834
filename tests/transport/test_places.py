"""The leaf that a point lies on, against a look at all leaves."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.engine.world import World
from solver.transport.elements import ElementTree
from solver.transport.places import leaves_at
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray, IntArray, Points
from tests.transport.solving import solved


@cache
def sample(name: str) -> RadiositySolver:
    return solved(World.of(load_sample(name)), 0.05)


def depth(tree: ElementTree, leaves: IntArray, position: Points) -> FloatArray:
    """How far within its nearest edge a point (3,) is in each leaf (k,), metres; below 0 outside."""
    corners = tree.corners[leaves]
    normal = tree.patch_normal[tree.patch[leaves]]
    edges = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(edges, axis=2)
    left = np.cross(normal[:, None], edges) / np.maximum(length, 1e-30)[:, :, None]
    height = np.einsum("ka,kna->kn", np.zeros((len(leaves), 3)) + position, left) - np.einsum(
        "kna,kna->kn", corners, left
    )
    return np.asarray(np.where(length > 0.0, height, np.inf).min(axis=1))


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_leaves_are_those_that_a_look_at_all_finds(name: str) -> None:
    """On triangles and quadrilaterals that were split: but for points on edges between two leaves."""
    tree = sample(name).state.tree
    random = np.random.default_rng(3)
    leaves = tree.leaves
    chosen = random.choice(leaves, 800).astype(np.int32)
    position = np.einsum("nk,nka->na", random.dirichlet(np.ones(4), 800), tree.corners[chosen])
    patch = tree.patch[chosen].astype(np.int32)
    found = leaves_at(tree, position, patch)
    assert np.all(tree.child[found] < 0)
    np.testing.assert_array_equal(tree.patch[found], patch)
    size = np.linalg.norm(np.ptp(tree.corners.reshape(-1, 3), axis=0))
    for at, p, leaf in zip(position, patch.tolist(), found.tolist(), strict=True):
        own = leaves[tree.patch[leaves] == p]
        inside = depth(tree, own, at)
        if inside.max() > 1e-9 * size:
            assert leaf == own[np.argmax(inside)]
    assert np.mean(found == chosen) > 0.99


def test_points_beyond_a_patch_get_a_leaf_at_its_border() -> None:
    tree = sample("cornell").state.tree
    floor = int(np.argmax(tree.patch_normal[:, 1] > 0.9))
    leaves = tree.leaves[tree.patch[tree.leaves] == floor]
    corner = tree.corners[floor, 0]
    middle = tree.corners[floor].mean(axis=0)
    beyond = corner + 0.01 * (corner - middle)
    (found,) = leaves_at(tree, beyond[None], np.array([floor], dtype=np.int32)).tolist()
    at_corner = [k for k in leaves.tolist() if np.any(np.all(np.isclose(tree.corners[k], corner), axis=1))]
    assert found in at_corner


def test_patches_that_are_leaves_are_found_and_no_points_are_none() -> None:
    tree = sample("office").state.tree
    whole = np.flatnonzero(tree.child[: len(tree.patch_normal)] < 0).astype(np.int32)
    assert len(whole) > 0
    np.testing.assert_array_equal(leaves_at(tree, tree.corners[whole].mean(axis=1), whole), whole)
    assert len(leaves_at(tree, np.empty((0, 3)), np.empty(0, dtype=np.int32))) == 0
