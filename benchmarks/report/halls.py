"""Scenes of as many polygons as are wanted, for what time and memory do as scenes grow.

`offices` grow as buildings do: more desks, each with a lamp of its own, in a larger hall. `sphere` stays what
it is, a ball in a room with one lamp, and is cut into ever more triangles: its light hardly changes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver.document.samples import load_sample
from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.geometry.transform import Transform
from solver.types import FloatArray, Points

_FURNITURE: Final = ("desk", "monitor", "stand", "books", "seat", "back_rest", "cabinet")
_CELL: Final = (4.0, 3.2)
"""Metres of a desk's place"""

_HEIGHT: Final = 2.6
_POLYGONS_OF_A_DESK: Final = 67
_INWARD: Final = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))

_WALLS: Final = Material(np.array([0.7, 0.68, 0.65]), np.zeros(3))
_LAMP: Final = Material(np.zeros(3), np.array([60.0, 56.0, 50.0]))


@dataclass(frozen=True)
class Family:
    """Scenes that differ in how many polygons they have."""

    name: str
    of: Callable[[int], Scene]
    """The scene of about so many polygons"""
    sizes: tuple[int, ...]
    """Polygons, about"""


def offices(polygons: int) -> Scene:
    """A hall of desks."""
    desks = max(1, round((polygons - 6) / _POLYGONS_OF_A_DESK))
    across = math.ceil(math.sqrt(desks))
    deep = -(-desks // across)
    width, depth = across * _CELL[0], deep * _CELL[1]
    sample = load_sample("office")
    objects = [_box("walls", (0.0, 0.0, 0.0), (width, depth, _HEIGHT))]
    for number in range(desks):
        place = np.eye(4)
        place[:2, 3] = _CELL[0] * (number % across), _CELL[1] * (number // across)
        for name in _FURNITURE:
            part = sample.object(name)
            moved = Transform(place @ part.transform.matrix)
            objects.append(replace(part, id=f"{name}{number}", transform=moved))
        objects.append(_lamp(f"lamp{number}", place[:3, 3] + [1.6, 1.2, _HEIGHT - 0.01], 0.6))
    camera = Camera(
        eye=np.array([0.9 * width, 0.1, 2.0]),
        target=np.array([0.4 * width, 0.7 * depth, 0.7]),
        up=np.array([0.0, 0.0, 1.0]),
        vertical_fov=60.0,
        width=640,
        height=480,
    )
    return _scene(objects, camera)


def sphere(polygons: int) -> Scene:
    """A room with a ball of 20 times a power of 4 triangles, and a lamp."""
    times = max(0, round(math.log(polygons / 20.0, 4.0)))
    points, triangles = icosphere(times)
    ball = Mesh(np.array([1.5, 1.5, 0.8]) + 0.7 * points, tuple(map(tuple, triangles.tolist())))
    objects = [
        _box("walls", (0.0, 0.0, 0.0), (3.0, 3.0, 3.0)),
        SceneObject("ball", ball, _WALLS),
        _lamp("lamp", np.array([0.6, 0.6, 2.98]), 0.8),
    ]
    camera = Camera(
        eye=np.array([2.8, 0.2, 1.8]),
        target=np.array([1.4, 1.6, 0.8]),
        up=np.array([0.0, 0.0, 1.0]),
        vertical_fov=60.0,
        width=640,
        height=480,
    )
    return _scene(objects, camera)


def icosphere(times: int) -> tuple[Points, FloatArray]:
    """Points (n, 3) of the unit sphere and triangles (20 * 4^times, 3), counter-clockwise from outside."""
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    flat = [(a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    points = np.array([p for a, b in flat for p in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))])
    points /= np.linalg.norm(points[0])
    edge = np.linalg.norm(points[:, None] - points[None, :], axis=2)
    near = (edge > 0.0) & (edge < 1.1 * edge[edge > 0.0].min())
    triangles = np.array(
        [
            (a, b, c) if np.linalg.det(points[[a, b, c]]) > 0.0 else (a, c, b)
            for a in range(12)
            for b in range(a + 1, 12)
            for c in range(b + 1, 12)
            if near[a, b] and near[b, c] and near[a, c]
        ]
    )
    for _ in range(times):
        points, triangles = _split(points, triangles)
    return points, triangles


def _split(points: Points, triangles: FloatArray) -> tuple[Points, FloatArray]:
    """Each triangle cut into four, the new points pushed out to the unit sphere."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    middles = points[unique].mean(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    ab, bc, ca = (number.reshape(-1, 3) + len(points)).T
    a, b, c = triangles.T
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([points, middles]), np.concatenate([np.stack(part, axis=1) for part in parts])


def _box(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> SceneObject:
    """Six walls seen from inside."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    floor = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    corners = np.array([[x, y, z] for z in (z0, z1) for x, y in floor])
    return SceneObject(name, Mesh(corners, _INWARD), _WALLS)


def _lamp(name: str, at: FloatArray, side: float) -> SceneObject:
    """A square that shines down."""
    corners = at + side * np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    return SceneObject(name, Mesh(corners, ((0, 1, 2, 3),)), _LAMP)


def _scene(objects: list[SceneObject], camera: Camera) -> Scene:
    return Scene(objects={o.id: o for o in objects}, cameras={"main": camera})


FAMILIES: Final = {
    family.name: family
    for family in (
        Family("offices", offices, (100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)),
        Family("sphere", sphere, (320, 1_280, 5_120, 20_480, 81_920)),
    )
}
