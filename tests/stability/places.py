"""Scenes of a room with a lamp in it, and what stands in the room; in metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np

from solver.engine.world import World
from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.types import FloatArray, Points, Vector
from tests.accuracy.test_cie171 import bulb
from tests.pathtracing.worlds import material, polygon
from tests.transport.solving import box

WIDTH: Final = 32
HEIGHT: Final = 24

GREY: Final = material(0.5)
BOTH: Final = material(0.5, 0.0, True)
"""Grey on both sides"""
SHINING: Final = material(0.0, 10.0)
"""Black lamps of 10 W/m2"""

Triple: TypeAlias = Sequence[float] | Vector

X: Final = np.array([1.0, 0.0, 0.0])
Y: Final = np.array([0.0, 1.0, 0.0])
UP: Final = np.array([0.0, 0.0, 1.0])


def scene(*objects: SceneObject) -> Scene:
    """A scene with a small camera, which looks in from near a corner of the bounding box."""
    bare = Scene(objects={o.id: o for o in objects})
    return Scene(objects=bare.objects, cameras={"main": looking_in(bare)})


def seen_from(eye: Vector, target: Vector) -> Camera:
    """A small camera."""
    return Camera(eye, target, np.array([0.12, 0.07, 0.99]), 70.0, WIDTH, HEIGHT)


def looking_in(of: Scene) -> Camera:
    """From near one corner of the bounding box towards the opposite one."""
    surfaces = World.of(of).surfaces
    corners = surfaces.corners.reshape(-1, 3)
    half = 0.5 * np.ptp(corners, axis=0) if len(corners) else np.ones(3)
    eye = surfaces.center + half * [0.83, 0.71, 0.62] + 1e-3 * surfaces.size
    return seen_from(eye, surfaces.center - 0.3 * half)


def quad(name: str, at: Triple, u: Triple, v: Triple, of: Material) -> SceneObject:
    """A parallelogram from a corner along two sides; its front is where u x v points."""
    a, b, c = np.array(at, dtype=float), np.array(u, dtype=float), np.array(v, dtype=float)
    return polygon(name, np.stack([a, a + b, a + b + c, a + c]), of)


def room(reflectance: float = 0.5, emission: float = 0.0, name: str = "room") -> SceneObject:
    """The unit cube seen from inside."""
    return box(name, reflectance, emission)


def lamp(height: float = 0.9, of: Material = SHINING, name: str = "lamp") -> SceneObject:
    """0.16 m2 that shine down, over the middle of the room."""
    return quad(name, [0.3, 0.3, height], [0.0, 0.4, 0.0], [0.4, 0.0, 0.0], of)


def crate(name: str, low: Triple, high: Triple, reflectance: float = 0.5) -> SceneObject:
    """A box seen from outside."""
    return box(name, reflectance, 0.0, list(low), list(high), inward=False)


def ball(
    name: str,
    splits: int,
    of: Material,
    inward: bool = False,
    radius: float = 0.3,
    at: Triple = (0.5, 0.5, 0.5),
) -> SceneObject:
    """An icosphere of 20 x 4^splits triangles."""
    made = bulb((at[0], at[1], at[2]), radius, 1.0, splits)
    faces = tuple(face[::-1] for face in made.mesh.faces) if inward else made.mesh.faces
    return SceneObject(name, Mesh(made.mesh.vertices, faces), of)


def grid(n: int, low: float = 0.05, high: float = 0.95, height: float = 0.0) -> Points:
    """(n^2, 3) points over a square at a height, off all that is symmetric."""
    at = low + (high - low) * (np.arange(n) + 0.47) / n
    x, y = np.meshgrid(at, at + 0.003)
    return np.stack([x.ravel(), y.ravel(), np.full(n * n, height)], axis=1)


def transformed(
    of: Scene, turn: FloatArray | None = None, shift: Vector | float = 0.0, scale: float = 1.0
) -> Scene:
    """The scene with its vertices turned by (3, 3), scaled, and moved by metres; its camera with it."""
    turn = np.eye(3) if turn is None else turn

    def place(points: Points) -> Points:
        return np.asarray(scale * (points @ turn.T) + shift)

    objects = {o.id: SceneObject(o.id, Mesh(place(o.world_vertices), o.mesh.faces), o.material) for o in of}
    cameras = {
        name: Camera(place(c.eye), place(c.target), turn @ c.up, c.vertical_fov, c.width, c.height)
        for name, c in of.cameras.items()
    }
    return Scene(objects=objects, cameras=cameras)
