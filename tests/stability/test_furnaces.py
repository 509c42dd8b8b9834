"""Furnaces of many irregular polygons: closed, all of one material. Right means: E / (1 - rho) everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from solver.engine.drawing import Drawing
from solver.geometry.scene import Mesh, Scene, SceneObject
from solver.types import FloatArray
from tests.pathtracing.worlds import CUBE, INWARD, material
from tests.stability.chain import assert_sound, irradiance, power, solve
from tests.stability.places import UP, ball, scene
from tests.transport.polygons import rotation


def crazy_paving(triangles: int, seed: int) -> list[FloatArray]:
    """Triangles (3, 2) of all shapes and sizes that tile the unit square, with the same ends on all sides."""
    random = np.random.default_rng(seed)
    inner = random.beta(0.6, 0.6, (max(1, (triangles - 8) // 2), 2))
    sides = np.array(
        [[0.0, 0.0], [0.41, 0.0], [1.0, 0.0], [1.0, 0.33], [1.0, 1.0], [0.2, 1.0], [0.0, 1.0], [0.0, 0.7]]
    )
    points = np.concatenate([sides, 1e-3 + 0.998 * inner])
    return [points[corners] for corners in Delaunay(points).simplices]


def furnace(polygons: int, reflectance: float) -> Scene:
    """A cube, turned out of all axes, of irregular triangles that emit 1 W/m2."""
    objects = []
    turn = rotation(11)
    for wall, face in enumerate(INWARD):
        a, b, _, d = CUBE[list(face)]
        corners = []
        for piece in crazy_paving(polygons // 6, wall):
            u, v = piece[1] - piece[0], piece[2] - piece[0]
            # Seen from inside, walls turn left.
            corners.append(piece if u[0] * v[1] - u[1] * v[0] > 0.0 else piece[::-1])
        flat = np.concatenate(corners)
        vertices = (a + flat[:, :1] * (b - a) + flat[:, 1:] * (d - a)) @ turn.T
        faces = tuple((k, k + 1, k + 2) for k in range(0, len(vertices), 3))
        objects.append(SceneObject(f"{wall}", Mesh(vertices, faces), material(reflectance, 1.0)))
    return scene(*objects)


@pytest.mark.parametrize("reflectance", [0.5, 0.99])
@pytest.mark.parametrize("polygons", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_irregular_polygons(polygons: int, reflectance: float, drawing: Drawing) -> None:
    engine = solve(furnace(polygons, reflectance), drawing)
    assert_sound(engine, frames=polygons == 100 and reflectance == 0.5)
    status = engine.status().statistics
    assert status.closed and status.polygons > 0.8 * polygons
    expected = 1.0 / (1.0 - reflectance)
    np.testing.assert_allclose(engine._solution.field().radiosity, expected, rtol=5e-3)
    at = (np.array([[0.5, 0.5, 0.5], [0.2, 0.3, 0.9], [0.999, 0.5, 0.001]])) @ rotation(11).T
    np.testing.assert_allclose(irradiance(engine, at, UP), expected, rtol=0.01)


def test_a_ball_seen_from_inside(drawing: Drawing) -> None:
    """320 triangles that all see each other."""
    engine = solve(scene(ball("ball", 2, material(0.8, 1.0), inward=True)), drawing)
    assert_sound(engine, frames=False)
    np.testing.assert_allclose(engine._solution.field().radiosity, 5.0, rtol=5e-3)


def test_a_ball_with_one_bright_triangle(drawing: Drawing) -> None:
    """In a sphere all points receive alike, whatever shines: the geometric series of the mean."""
    made = ball("ball", 2, material(0.5), inward=True, radius=1.0, at=(0.0, 0.0, 0.0))
    first, rest = made.mesh.faces[:1], made.mesh.faces[1:]
    bright = SceneObject("bright", Mesh(made.mesh.vertices, first), material(0.5, 100.0))
    others = SceneObject("others", Mesh(made.mesh.vertices, rest), material(0.5))
    engine = solve(scene(bright, others), drawing)
    assert_sound(engine, frames=False)
    emitted, _ = power(engine)
    mean = emitted / 0.5 / float(engine._world.surfaces.area.sum())
    field = engine._solution.field()
    assert np.average(field.irradiance[:, 0], weights=field.area) == pytest.approx(mean, rel=5e-3)
    # Triangles are flat, and their neighbours are seen at angles that the sphere does not have.
    far = field.corners[:, :3].mean(axis=1) @ field.corners[0, :3].mean(axis=0) < 0.5
    np.testing.assert_allclose(field.irradiance[far, 0], mean, rtol=0.05)


def test_points_of_a_furnace_in_its_corners(drawing: Drawing) -> None:
    engine = solve(furnace(60, 0.5), drawing)
    turn = rotation(11)
    for near in (1e-3, 1e-6, 1e-9):
        corner = np.array([[near, near, near], [1.0 - near, near, 0.5], [0.5, 1.0 - near, near]]) @ turn.T
        np.testing.assert_allclose(irradiance(engine, corner, turn @ (UP + 0.1)), 2.0, rtol=0.01)
