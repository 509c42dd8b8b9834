"""Polygons that are not convex, wind like spirals, or have next to no area. Right means: as their pieces."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.geometry.scene import Mesh, SceneObject
from solver.types import FloatArray
from tests.pathtracing.worlds import polygon
from tests.stability.chain import assert_sound, assert_traced, irradiance, power, solve
from tests.stability.places import BOTH, GREY, SHINING, UP, X, Y, grid, lamp, quad, room, scene


def spiral(turns: float, points: int, width: float) -> FloatArray:
    """A band (2 points, 2) that winds outwards from the origin to a radius of 1."""
    angle = 2.0 * np.pi * turns * np.linspace(0.15, 1.0, points)
    radius = angle / angle[-1]
    ray = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([(radius * ray.T).T, ((radius - width) * ray.T).T[::-1]])


def comb(teeth: int) -> FloatArray:
    """A comb (n, 2) within the unit square: half of it above its back."""
    x = np.linspace(0.0, 1.0, 2 * teeth + 1)
    up = [[x[k], y] for k in range(2 * teeth, -1, -1) for y in ((1.0, 0.2) if k % 2 else (0.2, 1.0))]
    return np.array([[0.0, 0.0], [1.0, 0.0], *up[:-1]])


def laid(name: str, flat: FloatArray, height: float, size: float = 0.3) -> SceneObject:
    """A polygon (n, 2) over the middle of the room, seen from above and from below."""
    return polygon(name, np.column_stack([0.5 + size * flat, np.full(len(flat), height)]), BOTH)


def pieces(band: FloatArray, height: float) -> list[SceneObject]:
    """The quadrilaterals of a band."""
    n = len(band) // 2
    inner = band[: n - 1 : -1]
    return [
        laid(f"{k}", np.stack([band[k], band[k + 1], inner[k + 1], inner[k]]), height) for k in range(n - 1)
    ]


def test_a_spiral_is_its_pieces(drawing: Drawing) -> None:
    band = spiral(3.0, 49, 0.12)
    whole = solve(scene(room(), lamp(), laid("spiral", band, 0.4)), drawing)
    assert_sound(whole)
    assert_traced(whole, grid(4), UP)
    parts = solve(scene(room(), lamp(), *pieces(band, 0.4)), drawing)
    assert power(whole) == pytest.approx(power(parts), rel=0.02)
    np.testing.assert_allclose(irradiance(whole, grid(5), UP), irradiance(parts, grid(5), UP), rtol=0.05)


@pytest.mark.parametrize("turn", [0, 7, 30])
def test_the_first_corner_does_not_matter(turn: int, drawing: Drawing) -> None:
    band = spiral(2.0, 25, 0.2)
    one, other = (
        solve(scene(room(), lamp(), laid("s", np.roll(band, k, axis=0), 0.4)), drawing) for k in (0, turn)
    )
    area = [float(e._world.surfaces.area.sum()) for e in (one, other)]
    assert area[0] == pytest.approx(area[1], rel=1e-12)
    np.testing.assert_allclose(irradiance(one, grid(4), UP), irradiance(other, grid(4), UP), rtol=0.05)


def test_a_comb_before_the_lamp(drawing: Drawing) -> None:
    engine = solve(scene(room(), lamp(), laid("comb", comb(30) - 0.5, 0.6, 0.8)), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(4), UP)


def test_a_lamp_that_is_a_star(drawing: Drawing) -> None:
    """In a black room: as much light as its triangles give."""
    angle = np.pi * np.arange(20) / 10
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.where(np.arange(20) % 2, 0.1, 0.3)[:, None]
    star = np.column_stack([0.5 + flat, np.full(20, 0.9)])[::-1]
    middle = np.array([0.5, 0.5, 0.9])
    whole = polygon("star", star, SHINING)
    rays = [polygon(f"{k}", np.stack([star[k - 1], star[k], middle]), SHINING) for k in range(20)]
    a, b = (solve(scene(room(0.0), *of), drawing) for of in ([whole], rays))
    assert_sound(a)
    np.testing.assert_allclose(irradiance(a, grid(5), UP), irradiance(b, grid(5), UP), rtol=1e-6)


@pytest.mark.parametrize("width", [1e-5, 1e-7, 1e-9, 1e-12, 0.0])
def test_faces_of_almost_no_area(width: float, drawing: Drawing) -> None:
    """Whether they are kept or dropped, nothing is lit less, and nothing more."""
    thin = quad("thin", [0.2, 0.5, 0.5], 0.6 * X, width * Y, BOTH)
    speck = polygon("speck", 0.5 + width * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), BOTH)
    needle = polygon("needle", [(0.2, 0.2, 0.5), (0.8, 0.2, 0.5), (0.5, 0.2 + width, 0.5)], BOTH)
    bare, engine = (solve(scene(room(), lamp(), *of), drawing) for of in ([], [thin, speck, needle]))
    assert_sound(engine, frames=width in (1e-7, 0.0))
    np.testing.assert_allclose(irradiance(engine, grid(5), UP), irradiance(bare, grid(5), UP), rtol=0.02)


def test_faces_that_are_not_planar_or_repeat_a_corner(drawing: Drawing) -> None:
    vertices = np.array([[0.2, 0.2, 0.4], [0.8, 0.2, 0.5], [0.8, 0.8, 0.4], [0.2, 0.8, 0.5], [0.8, 0.8, 0.4]])
    saddle = SceneObject("saddle", Mesh(vertices, ((0, 1, 2, 3),)), BOTH)
    double = SceneObject("double", Mesh(vertices - 0.1 * UP, ((0, 1, 2, 4, 3), (0, 0, 1, 2))), BOTH)
    engine = solve(scene(room(), lamp(), saddle, double), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(4), UP)


def test_a_bow_tie_is_told_of(drawing: Drawing) -> None:
    tie = polygon("tie", [(0.2, 0.2, 0.4), (0.8, 0.8, 0.4), (0.8, 0.2, 0.4), (0.2, 0.7, 0.4)], GREY)
    engine = solve(scene(room(), lamp(), tie), drawing)
    assert_sound(engine)
    assert any("crossing itself" in told for told in engine.status().warnings)
