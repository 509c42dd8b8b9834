"""Whether a scene is closed, and the row sums that closed and open scenes get."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.world import World
from solver.geometry.scene import Mesh, SceneObject
from solver.transport.closure import balance, is_closed, of_patches
from solver.transport.field import SolveOutcome
from solver.transport.pushpull import patch_sums
from tests.pathtracing.worlds import CUBE, INWARD, OUTWARD, material, polygon, world
from tests.transport.solving import (
    box,
    furnace,
    leaves_of,
    lit_cube,
    raw_rows,
    shelf,
    solved,
    state_of,
)


def without_a_face(share: float) -> World:
    """The unit cube whose ceiling leaves a gap of this share of it."""
    faces = [
        SceneObject(f"face{k}", Mesh(CUBE, (face,)), material(0.5, 1.0 if k == 0 else 0.0))
        for k, face in enumerate(INWARD)
        if k != 1
    ]
    lid = np.array([[0, 0, 1], [0, 1, 1], [1 - share, 1, 1], [1 - share, 0, 1]])
    return world(*faces, polygon("lid", lid, material(0.5)))


@pytest.mark.parametrize(
    ("closed", "scene"),
    [
        (True, lit_cube()),
        (True, furnace(0.5)),
        (True, shelf(two_sided=True)),
        (True, world(box("far", 0.5, 1.0, (1e4, 0, 0), (1.1e4, 10, 10)))),
        (True, world(box("thin", 0.5, 1.0, high=(1.0, 1.0, 1e-3)))),
        (False, shelf(two_sided=False)),
        (False, without_a_face(1e-2)),
        (False, without_a_face(0.5)),
        (False, world(box("outside", 0.5, 1.0, inward=False))),
        (False, world(polygon("floor", [[0, 0, 0], [1, 0, 0], [1, 1, 0]], material(0.5, 1.0)))),
        (False, world()),
    ],
    ids=["cube", "block", "two-sided board", "far away", "thin", "one-sided board", "slit", "half a roof",
         "from outside", "one face", "nothing"],
)  # fmt: skip
def test_is_closed(closed: bool, scene: World) -> None:
    assert is_closed(scene.surfaces, scene.rays) is closed
    assert solved(scene, 0.2).statistics().closed is closed


@pytest.mark.parametrize(
    "scene", [lit_cube(), furnace(0.5), shelf(two_sided=True)], ids=["cube", "block", "board"]
)
def test_balanced_rows_of_a_closed_scene_are_1(scene: World) -> None:
    """A uniform field is seen as uniform: mean 1, no gradient."""
    solver = solved(scene, 0.05)
    state = state_of(solver)
    one = np.zeros((len(state.tree), 3, 1))
    one[:, 0] = 1.0
    rows = state.gather(one)[leaves_of(state)][:, :, 0]
    np.testing.assert_allclose(rows[:, 0], 1.0, rtol=1e-12)
    extent = np.sqrt(state.tree.area[leaves_of(state)])
    np.testing.assert_allclose(rows[:, 1:] * extent[:, None], 0.0, atol=1e-12)


def test_rows_of_an_open_scene_are_those_of_its_links() -> None:
    solver = solved(without_a_face(0.5), 0.05)
    state = state_of(solver)
    np.testing.assert_array_equal(state.closure, 1.0)
    assert not state.remainder.any()
    assert raw_rows(solver).max() < 1.05


def nearly_closed() -> World:
    """The white unit cube with a block in it and a slit in its roof: row sums err above 1."""
    faces = [SceneObject(f"face{k}", Mesh(CUBE, (f,)), material(0.999)) for k, f in enumerate(INWARD)]
    lid = SceneObject("lid", Mesh(CUBE * [1 - 1e-3, 1, 1], (INWARD[1],)), material(0.999, 1.0))
    block = SceneObject("block", Mesh(0.3 + 0.3 * CUBE, OUTWARD), material(0.999))
    return world(faces[0], *faces[2:], lid, block)


@pytest.mark.parametrize("before", [1.0, 0.7, "balanced"])
def test_balance_goes_on_from_anywhere_and_comes_to_the_same(before: float | str) -> None:
    state = state_of(solved(nearly_closed(), 0.2))
    for _ in range(3):
        for _ in balance(state, closed=False):
            pass
    known = state.closure.copy()
    assert known.min() < 0.999
    if isinstance(before, float):
        state.closure = np.full(len(known), before)
    for _ in range(3):
        for _ in balance(state, closed=False):
            pass
    np.testing.assert_allclose(state.closure, known, rtol=2e-3)
    if before == "balanced":
        np.testing.assert_array_equal(state.closure, known)


def test_sums_of_patches_are_those_of_a_gather() -> None:
    state = state_of(solved(nearly_closed(), 0.2))
    scale = np.random.default_rng(2).uniform(0.2, 1.0, state.tree.patch_count)
    leaf = leaves_of(state)
    state.closure[leaf] = scale[state.tree.patch[leaf]]
    one = np.zeros((len(state.tree), 3, 1))
    one[:, 0] = 1.0
    gathered = of_patches(state.tree, state.gather(one)[:, 0, 0])
    sums = patch_sums(state.tree, state.links, state.links.exchange, scale)
    np.testing.assert_allclose(sums, gathered, rtol=1e-12)


def test_open_scenes_do_not_multiply_light() -> None:
    """Row sums that err above 1 times a reflectance of nearly 1 would."""
    solver = solved(nearly_closed(), 0.2)
    state = state_of(solver)
    one = np.zeros((len(state.tree), 3, 1))
    one[:, 0] = 1.0
    rows = state.gather(one)[leaves_of(state), 0, 0]
    leaf = leaves_of(state)
    patch, area = state.tree.patch[leaf], state.tree.area[leaf]
    of_patch = np.bincount(patch, area * rows) / np.bincount(patch, area)
    assert of_patch.max() < 1.002
    assert solver.outcome is SolveOutcome.CONVERGED
    radiosity = solver.field().radiosity
    assert np.all(np.isfinite(radiosity))
    assert np.all(radiosity >= 0.0)
