"""Rays that leave their surfaces by next to nothing: they do not meet these, and meet what is right above."""

from __future__ import annotations

import numpy as np
import pytest

from solver import tolerances
from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.transport.elements import ElementTree
from solver.types import BoolArray, FloatArray, Points
from solver.visibility.lifts import ray_lifts
from solver.visibility.pair_rays import STRATA, generate_rays
from solver.visibility.rays import RayScene

FLOOR = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
WALL = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.0]])
SAMPLES = 4096


def surfaces_of(*polygons: Points) -> Surfaces:
    """Of one scene."""
    grey = Material(np.full(3, 0.5), np.zeros(3))
    return flatten(
        Scene(
            objects={
                str(k): SceneObject(str(k), Mesh(polygon, (tuple(range(len(polygon))),)), grey)
                for k, polygon in enumerate(polygons)
            }
        )
    )


def blocked(s: Surfaces, p: int = 0, q: int = 1) -> BoolArray:
    """Which of the rays between two patches are stopped, of those that have a weight."""
    tree, rays = ElementTree(s), RayScene(s.triangles, s.center, s.size)
    n = STRATA * SAMPLES
    origins, directions = np.empty((2, n, 3), dtype=np.float32)
    weights, strata = np.empty(n), np.empty(n, dtype=np.uint8)
    places = np.empty((n, 4), dtype=np.float32)
    ends = np.array([p], dtype=np.int32), np.array([q], dtype=np.int32)
    generate_rays(
        *ends, SAMPLES, tree.corners, tree.corner_count, tree.area, tree.patch, s.normal, tree.axes,
        ray_lifts(s.corners, s.normal, s.size), tree.centroid, tree.key, rays.center, rays.scale, 0, 0, 1,
        origins, directions, weights, strata, places,
    )  # fmt: skip
    return np.asarray(rays.occluded_local(origins, directions)[weights > 0.0])


def turned(polygon: Points, seed: int, shift: float, scale: float) -> Points:
    """In any place, at any angle, the first of which is none."""
    turn: FloatArray = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn = turn * np.linalg.det(turn) if seed else np.eye(3)
    return np.asarray(scale * (polygon @ turn.T) + shift)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize(("shift", "scale"), [(0.0, 1.0), (1e5, 1.0), (-30.0, 1e-3), (1e5, 1e4)])
def test_nothing_stops_rays_between_two_walls(seed: int, shift: float, scale: float) -> None:
    """They meet in an edge, where rays leave both at any angle."""
    s = surfaces_of(turned(FLOOR, seed, shift, scale), turned(WALL, seed, shift, scale))
    assert not blocked(s).any()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("bend", [1e-7, 1e-6, 5e-6, -5e-6])
def test_nothing_stops_rays_from_what_is_not_quite_plane(seed: int, bend: float) -> None:
    """Two triangles instead of a surface that is bent."""
    floor = FLOOR.copy()
    floor[2, 2] += bend
    wall = np.array([[1.0, 0.0, 0.1], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.1]])
    s = surfaces_of(turned(floor, seed, 0.0, 1.0), turned(wall, seed, 0.0, 1.0))
    assert s.patch_count == 2, "the floor is one quadrilateral still"
    assert not blocked(s).any()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("gap", [1e-4, 1e-5, 1e-6, 6e-7])
def test_what_lies_close_over_a_surface_hides_it(seed: int, gap: float) -> None:
    """Down to little more than half a millionth of the scene."""
    wide = FLOOR[::-1] + 0.1 * np.sign(FLOOR[::-1] - 0.5)
    wide[:, 2] = gap * np.sqrt(1.2**2 + 1.2**2 + 1.0)
    far = FLOOR[::-1] + np.array([0.0, 0.0, 1.0])
    s = surfaces_of(*(turned(polygon, seed, 0.0, 1.0) for polygon in (FLOOR, far, wide)))
    assert blocked(s).all()


def test_lifts_are_the_least_where_polygons_are_plane() -> None:
    s = surfaces_of(FLOOR, WALL, FLOOR[:3] + 0.3)
    np.testing.assert_allclose(ray_lifts(s.corners, s.normal, s.size), tolerances.LEAST_RAY_OFFSET, rtol=1e-6)
    assert tolerances.LEAST_RAY_OFFSET < tolerances.RAY_OFFSET
