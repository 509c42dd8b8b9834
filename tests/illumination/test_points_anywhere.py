"""Irradiance at points: exact where nothing is in the way, and honest about its error where something is."""

from __future__ import annotations

import numpy as np
import pytest

from solver.pathtracing import PathTracer
from solver.transport.lambert import points_to_polygon
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Points
from tests.pathtracing.worlds import material, polygon, square, world
from tests.transport.polygons import regular, rotation
from tests.transport.solving import irradiance_at, lit_cube, shelf, solved


def points(n: int, seed: int = 1) -> tuple[Points, FloatArray]:
    """Points and normals anywhere in the unit cube."""
    random = np.random.default_rng(seed)
    normals = random.normal(size=(n, 3))
    return random.uniform(0.05, 0.95, (n, 3)), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_constant_emitters_are_exact() -> None:
    """Quadrilaterals and triangles, tilted, partly behind the points' horizons, of several colours."""
    emitters = {
        "roof": (np.array([[0, 0, 2], [0, 1, 2], [1, 1, 2], [1, 0, 2]], dtype=float), (3.0, 2.0, 1.0)),
        "wall": (np.array([[3, 0, 0], [3, 0, 2], [3, 1, 1]], dtype=float), (0.1, 5.0, 0.3)),
        "tilted": (0.3 * regular(4, 1.0) @ rotation(4).T + [-1.0, -1.0, 0.5], (2.0, 2.0, 7.0)),
    }
    objects = [polygon(name, corners, material(0.0, e)) for name, (corners, e) in emitters.items()]
    positions, normals = points(200)
    found = irradiance_at(solved(world(*objects)), positions, normals)
    expected = np.zeros((200, 3))
    for corners, emission in emitters.values():
        front = points_to_polygon(positions, normals, corners)
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        front[(positions - corners[0]) @ normal < 0.0] = 0.0
        expected += front[:, None] * np.array(emission)
    assert np.count_nonzero(expected[:, 0]) > 100
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)


def test_points_on_surfaces_and_in_corners() -> None:
    """On the floor of a black cube, in a corner and at an edge too, under its ceiling."""
    cube = solved(lit_cube(0.0, 1.0), 0.05)
    lit = cube.surfaces.emission.any(axis=1)
    corners = cube.surfaces.corners[lit][0]
    random = np.random.default_rng(4)
    positions = np.concatenate([random.random((50, 3)) * [1, 1, 0], [[1e-4, 1e-4, 0], [0.5, 1e-6, 0]]])
    normals = np.tile([0.0, 0.0, 1.0], (52, 1))
    found = irradiance_at(cube, positions, normals)
    np.testing.assert_allclose(found[:, 0], points_to_polygon(positions, normals, corners), rtol=1e-10)


def test_black_backs_send_nothing() -> None:
    lamp = solved(world(square("lamp", material(0.0, 1.0), z=1.0)))
    positions, up = (
        np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 2.0]]),
        np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]),
    )
    found = irradiance_at(lamp, positions, up)
    assert found[0, 0] == 0.0
    assert found[1, 0] > 0.1


def shadowed() -> tuple[Points, FloatArray, FloatArray]:
    """Points below a board that hides a lamp in part; what is found there, and the truth.

    Nothing reflects, so that the solution is exact and all that errs is the gather. The truth is by
    the board's shadow: the lamp's part that a point sees beside it.
    """
    lamp = square("lamp", material(0.0, 1.0), z=1.0, down=True)
    board = polygon("board", [[-1, -1, 0.5], [0.5, -1, 0.5], [0.5, 2, 0.5], [-1, 2, 0.5]], material())
    solver = solved(world(lamp, board))
    random = np.random.default_rng(2)
    positions = random.random((400, 3)) * [1, 1, 0]
    normals = np.tile([0.0, 0.0, 1.0], (400, 1))
    found = irradiance_at(solver, positions, normals)
    # The edge x = 0.5 at half height casts its shadow at twice the distance.
    edge = np.clip(1.0 - positions[:, 0], 0.0, 1.0)
    truth = np.array(
        [
            points_to_polygon(p[None], n[None], np.array([[x, 0, 1], [x, 1, 1], [1, 1, 1], [1, 0, 1]]))[0]
            for p, n, x in zip(positions, normals, edge, strict=True)
        ]
    )
    return positions, found[:, 0], truth


def test_half_shadows_are_exact() -> None:
    _, found, truth = shadowed()
    np.testing.assert_allclose(found, truth, atol=1e-9)


@pytest.mark.parametrize("two_sided", [False, True])
def test_agrees_with_path_tracing_where_occluded(two_sided: bool) -> None:
    scene = shelf(two_sided)
    solver = solved(scene)
    positions, normals = points(400)
    found = irradiance_at(solver, positions, normals)
    truth, noise = PathTracer(scene.surfaces, scene.rays, 3).irradiance(positions, normals, 1024)
    off, y = (found - truth) @ LUMINANCE_WEIGHTS, truth @ LUMINANCE_WEIGHTS
    noise_power = float(np.sum((noise @ LUMINANCE_WEIGHTS) ** 2))
    assert np.sqrt(max(0.0, float(off @ off) - noise_power) / float(y @ y)) < solver.error_estimate


def test_batches_do_not_matter() -> None:
    solver = solved(shelf(), 0.05)
    positions, normals = points(3000)
    many = irradiance_at(solver, positions, normals)
    np.testing.assert_array_equal(irradiance_at(solver, positions[:5], normals[:5]), many[:5])
    assert irradiance_at(solver, positions[:0], normals[:0]).shape == (0, 3)
