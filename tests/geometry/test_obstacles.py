"""Faces that need not be asked what they hide: which they are, and that nothing is lost without them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.geometry.obstacles import ALL_BEFORE, ALL_BEHIND, ALONE, Obstacles, find_obstacles, is_needless
from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.types import BoolArray, FloatArray, IntArray, Points
from tests.illumination.shadow_scenes import FLOOR, SIDES, box, polygon, solid, square, surfaces_of
from tests.transport.polygons import rotation

UNIT = box((0, 0, 0), (1, 1, 1))


def kinds(*shapes: Points, without: tuple[int, ...] = (), triangulated: bool = False) -> list[int]:
    built = [solid(f"s{k}", shape, without, triangulated) for k, shape in enumerate(shapes)]
    found: list[int] = find_obstacles(surfaces_of(*built)).solid.tolist()
    return found


@pytest.mark.parametrize("triangulated", [False, True])
def test_boxes_are_solids_each_of_its_own(triangulated: bool) -> None:
    faces = 12 if triangulated else 6
    found = kinds(UNIT, UNIT + 0.5, UNIT + 2.0, triangulated=triangulated)
    assert found == [0] * faces + [1] * faces + [2] * faces


@pytest.mark.parametrize("side", range(6))
def test_a_box_without_one_side_is_a_solid_with_an_opening(side: int) -> None:
    obstacles = find_obstacles(surfaces_of(solid("s", UNIT, (side,))))
    assert obstacles.solid.tolist() == [0] * 5
    outward = np.zeros(3)
    outward[(2 - side // 2) if side < 2 else side // 2 - 1] = 1.0 if side % 2 else -1.0
    np.testing.assert_allclose(obstacles.bounds[0, 6:9], outward, atol=1e-12)
    assert obstacles.bounds[0, 9] == pytest.approx(1.0 if side % 2 else 0.0, abs=1e-12)


@pytest.mark.parametrize("without", [(0, 1), (0, 2), (0, 2, 4)])
def test_what_is_open_in_several_planes_is_no_solid(without: tuple[int, ...]) -> None:
    assert set(kinds(UNIT, UNIT + 3.0, without=without)).isdisjoint({0, 1})


def test_a_dented_box_is_no_solid_and_a_pyramid_is() -> None:
    dented = UNIT.copy()
    dented[7] = [0.4, 0.4, 0.4]
    assert set(kinds(dented, UNIT - 3.0, UNIT + 3.0, triangulated=True)[:12]) <= {ALONE, ALL_BEHIND}
    pyramid = UNIT.copy()
    pyramid[4:] = [[0.5, 0.5, 1.0]] * 4
    assert set(kinds(pyramid, triangulated=True)) == {0}


def test_walls_have_everything_before_them() -> None:
    roof = polygon("roof", square(2.0, 1.0, down=True))
    back = polygon("back", square(2.0, 2.0))
    found = find_obstacles(surfaces_of(FLOOR, roof, back)).solid
    assert found.tolist() == [ALL_BEFORE, ALONE, ALL_BEHIND]


def test_no_surfaces() -> None:
    assert len(find_obstacles(surfaces_of()).solid) == 0


@kernel
def _needless(x: Points, normals: FloatArray, at: Points, solid: IntArray, bounds: FloatArray) -> BoolArray:
    found = np.empty((len(x), len(solid)), dtype=np.bool_)
    for i in range(len(x)):
        for p in range(len(solid)):
            behind = ((x[i] - at[p]) * normals[p]).sum() < 0.0
            found[i, p] = is_needless(x[i], behind, solid[p], bounds, 1e-9)
    return found


def crossed(surfaces: Surfaces, x: Points, y: Points) -> BoolArray:
    """(n, p) whether the way from x to y (n, 3) goes through a patch."""
    base, normal = surfaces.corners[:, 0], surfaces.normal
    before = np.einsum("npa,pa->np", x[:, None] - base, normal)
    after = np.einsum("npa,pa->np", y[:, None] - base, normal)
    passes = before * after < 0.0
    share = before / np.where(passes, before - after, 1.0)
    at = x[:, None] + share[..., None] * (y - x)[:, None]
    for k in range(4):
        a = surfaces.corners[:, k]
        b = np.where(
            (k + 1 < surfaces.corner_count)[:, None], surfaces.corners[:, (k + 1) % 4], surfaces.corners[:, 0]
        )
        inward = np.cross(normal, b - a)
        length = np.linalg.norm(inward, axis=1)
        passes &= (np.einsum("npa,pa->np", at - a, inward) > 0.0) | (length == 0.0)
    return np.asarray(passes)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 1 << 30),
    turned=st.booleans(),
    without=st.sampled_from([(), *[(side,) for side in range(len(SIDES))]]),
)
def test_whatever_hides_something_is_or_goes_with_what_is_asked(
    seed: int, turned: bool, without: tuple[int, ...]
) -> None:
    """Between any two points: inside of solids and out, level with their faces, or past each other."""
    random = np.random.default_rng(seed)
    turn = rotation(seed) if turned else np.eye(3)
    shapes = [
        (box((0, 0, 0), random.uniform(0.1, 1.0, 3).tolist()) + random.uniform(-0.5, 0.5, 3)) @ turn.T
        for _ in range(3)
    ]
    surfaces = surfaces_of(*[solid(f"s{k}", shape, without) for k, shape in enumerate(shapes)], FLOOR)
    obstacles: Obstacles = find_obstacles(surfaces)
    assert np.all(np.isin(obstacles.solid[surfaces.object < 3], [0, 1, 2]))
    x, y = random.uniform(-1.0, 1.0, (2, 400, 3))
    level = random.random(400) < 0.3
    x[level, 2] = shapes[0][0, 2]
    x[~level & (random.random(400) < 0.2)] = np.concatenate(shapes).mean(axis=0)
    met = crossed(surfaces, x, y)
    needless = _needless(x, surfaces.normal, surfaces.corners[:, 0], obstacles.solid, obstacles.bounds)
    both_before = (x[:, 2] >= 0.0) & (y[:, 2] >= 0.0)
    # A face with all of the scene on one side is for what is on that side.
    walls = obstacles.solid < ALONE
    met[:, walls] &= both_before[:, None]
    assert np.array_equal(met.any(axis=1), (met & ~needless).any(axis=1))
    assert needless[:, obstacles.solid >= 0].any()
