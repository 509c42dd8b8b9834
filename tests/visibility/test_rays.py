"""Embree against the brute-force twin, wherever the answer does not hang on rounding."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver import tolerances
from solver.types import FloatArray
from solver.visibility.brute_force import blocking_margin, crossing_margins, first_hits
from solver.visibility.rays import CHUNK, RayScene, embree_version
from tests.visibility.soups import Soup, polygons, soup_of, soups

SEEDS = st.integers(0, 2**32 - 1)
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


@settings(max_examples=100)
@given(soups(anywhere=True), SEEDS)
def test_occlusion_is_that_of_brute_force(soup: Soup, seed: int) -> None:
    random = np.random.default_rng(seed)
    start, end = soup.points(random, 200), soup.points(random, 200)
    margin = blocking_margin(start, end, soup.surfaces.triangles)
    clear = np.abs(margin) > soup.tolerance
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(soup.rays.occluded(start, end)[clear], margin[clear] > 0.0)


@settings(max_examples=100)
@given(soups(anywhere=True), SEEDS)
def test_first_hits_are_those_of_brute_force(soup: Soup, seed: int) -> None:
    random = np.random.default_rng(seed)
    start = soup.points(random, 100)
    way = random.normal(size=(100, 3))
    reach = 4.0 * soup.surfaces.size / np.linalg.norm(way, axis=1).min()
    triangles = soup.surfaces.triangles
    found = soup.rays.intersect(start, way)
    triangle, distance = first_hits(start, way, triangles, reach)
    margins = crossing_margins(start, start + reach * way, triangles)
    clear = (np.abs(margins) > soup.tolerance).all(axis=1)
    assert clear.mean() > 0.8
    np.testing.assert_array_equal(found.triangle[clear] >= 0, triangle[clear] >= 0)
    hit = np.flatnonzero(clear & (triangle >= 0))
    # How far the point that was found is from the plane that should be hit: two may be as near as that.
    way, normal = way[hit], _normals(triangles)[found.triangle[hit]]
    error = np.abs(found.distance[hit] - distance[hit]) * np.abs(np.einsum("nk,nk->n", way, normal))
    assert np.all(error < soup.tolerance)


def test_twin_knows_a_square_from_its_neighbourhood() -> None:
    """The twin itself: by how much a ray meets or misses a square."""
    triangles = SQUARE[[[0, 1, 2], [0, 2, 3]]]
    through = np.array([[0.6, 0.2], [0.95, 0.5], [1.05, 0.5], [3.0, 0.5]])
    start = np.c_[through, np.full(4, 2.0)]
    margin = blocking_margin(start, np.c_[through, np.full(4, -1.0)], triangles)
    np.testing.assert_allclose(margin[:3], [0.2, 0.05, -0.05], atol=1e-12)
    assert margin[3] < -1.0
    margin = blocking_margin(start, np.c_[through, np.full(4, 0.25)], triangles)
    np.testing.assert_allclose(margin[:3], -0.25, atol=1e-12)
    assert margin[3] < -1.0
    triangle, distance = first_hits(start, np.tile([0.0, 0.0, -0.5], (4, 1)), triangles, 10.0)
    assert triangle[0] == triangle[1] == 0 and np.all(triangle[2:] == -1)
    np.testing.assert_array_equal(distance, [4.0, 4.0, np.inf, np.inf])


@settings(max_examples=60)
@given(st.lists(polygons(loose=True), min_size=1, max_size=1), st.sampled_from([1e-3, 1.0, 1e4]), SEEDS)
def test_lifted_points_do_not_see_their_own_surface(made: list[FloatArray], scale: float, seed: int) -> None:
    """Rays that leave a surface by the offset, at any angle above 0.1 degrees, are not stopped by it."""
    random = np.random.default_rng(seed)
    soup = soup_of([scale * made[0], scale * (made[0] + np.array([0.0, 0.0, 3.0]))])
    normal = soup.surfaces.normal[0]
    weights = random.dirichlet(np.ones(len(made[0])), 200)
    start = weights @ soup.polygon(0)
    lifted = start + tolerances.RAY_OFFSET * soup.surfaces.size * normal
    way = random.normal(size=(200, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    steep = way @ normal > np.sin(np.radians(0.1))
    end = lifted + 0.2 * scale * way
    others = soup.triangles_without(0)
    free = steep & (blocking_margin(lifted, end, others) < -soup.tolerance)
    assert not soup.rays.occluded(lifted, end)[free].any()


def test_targets_end_their_rays() -> None:
    """What lies behind a target does not block."""
    soup = soup_of([SQUARE, SQUARE + np.array([0.0, 0.0, 1.0])])
    start = np.array([[0.3, 0.4, 0.5]] * 3)
    end = np.array([[0.3, 0.4, 0.999], [0.3, 0.4, 1.001], [0.3, 0.4, 0.001]])
    np.testing.assert_array_equal(soup.rays.occluded(start, end), [False, True, False])


def test_an_empty_scene_stops_nothing() -> None:
    rays = RayScene(np.empty((0, 3, 3)), np.zeros(3), 1.0)
    points = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
    assert not rays.occluded(points, points[::-1]).any()
    hits = rays.intersect(points, points[::-1] + 1.0)
    assert np.all(hits.triangle == -1) and np.all(np.isinf(hits.distance))


@pytest.mark.parametrize("count", [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, 3 * CHUNK + 7])
def test_chunks_give_what_single_rays_give(count: int) -> None:
    soup = soup_of([SQUARE, SQUARE[:3] + np.array([0.3, 0.0, 0.5])])
    random = np.random.default_rng(count)
    start, end = soup.points(random, count), soup.points(random, count)
    blocked, hits = soup.rays.occluded(start, end), soup.rays.intersect(start, end - start)
    assert blocked.shape == hits.triangle.shape == hits.distance.shape == (count,)
    some = random.integers(0, count, 50) if count else np.empty(0, dtype=int)
    for k in some:
        one = slice(k, k + 1)
        assert soup.rays.occluded(start[one], end[one])[0] == blocked[k]
        assert soup.rays.intersect(start[one], (end - start)[one]).triangle[0] == hits.triangle[k]


def test_embree_tells_its_version() -> None:
    assert embree_version()[0].isdigit()


def _normals(triangles: FloatArray) -> FloatArray:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))
