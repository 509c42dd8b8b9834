"""Rooms drawn at random: what estimates are calibrated on, beside the samples.

They differ in what makes estimates hard: size and place of the lamps (a hand's breadth below a bright
ceiling, in a corner, many small ones), reflectance, furniture that shades, whether light leaves through a
missing wall.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.geometry.transform import Transform
from solver.types import FloatArray

_CUBE: Final = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
_INWARD: Final = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6))
"""Floor, ceiling, then the walls"""
_OUTWARD: Final = tuple(tuple(reversed(face)) for face in _INWARD)

_OPEN: Final = 0.3
"""Share of the rooms that lack a wall"""

_COLOURED: Final = 0.4
_LOW_LIGHT: Final = 0.1
"""Metres that half of the lamps hang below the ceiling, at most"""


def random_room(seed: int) -> Scene:
    """A room with furniture and lamps; equal seeds give equal rooms."""
    random = np.random.default_rng(seed)
    size = random.uniform((3.0, 3.0, 2.3), (8.0, 6.0, 3.5))
    wall = int(random.integers(2, 6)) if random.random() < _OPEN else None
    faces = tuple(face for number, face in enumerate(_INWARD) if number != wall)
    objects = [_shape(f"face {k}", _CUBE * size, (face,), _paint(random)) for k, face in enumerate(faces)]
    for number in range(int(random.integers(1, 7))):
        objects.append(_furniture(random, f"box {number}", size))
    if random.random() < 0.5:
        objects.append(_screen(random, size))
    for number in range(int(random.choice([1, 1, 1, 2, 4, 8]))):
        objects.append(_lamp(random, f"lamp {number}", size))
    eye = size * random.uniform((0.05, 0.05, 0.4), (0.2, 0.2, 0.8))
    camera = Camera(
        eye=eye,
        target=size * random.uniform((0.5, 0.5, 0.1), (0.9, 0.9, 0.5)),
        up=np.array([0.0, 0.0, 1.0]),
        vertical_fov=60.0,
        width=96,
        height=72,
    )
    return Scene(objects={o.id: o for o in objects}, cameras={"main": camera})


def _paint(random: np.random.Generator, two_sided: bool = False) -> Material:
    grey = random.uniform(0.05, 0.9)
    colour = np.full(3, grey)
    if random.random() < _COLOURED:
        colour = np.clip(grey * random.uniform(0.4, 1.4, 3), 0.02, 0.9)
    return Material(colour, np.zeros(3), two_sided)


def _shape(
    name: str,
    vertices: FloatArray,
    faces: tuple[tuple[int, ...], ...],
    material: Material,
    place: Transform | None = None,
) -> SceneObject:
    return SceneObject(name, Mesh(vertices, faces), material, place or Transform.identity())


def _furniture(random: np.random.Generator, name: str, size: FloatArray) -> SceneObject:
    """A box that stands on the floor, turned about the vertical, and hovers over it a little in places."""
    extent = random.uniform((0.2, 0.2, 0.1), (1.4, 1.4, 1.6))
    reach = 0.5 * float(np.hypot(extent[0], extent[1])) + 0.02
    spot = random.uniform((reach, reach), np.maximum(size[:2] - reach, reach + 1e-3))
    lift = 0.0 if random.random() < 0.6 else random.uniform(0.01, 0.3)
    angle = random.uniform(0.0, np.pi) if random.random() < 0.6 else 0.0
    place = Transform.from_parts(
        np.array([*spot, lift]), np.array([0.0, 0.0, np.sin(0.5 * angle), np.cos(0.5 * angle)]), np.ones(3)
    )
    return _shape(name, (_CUBE - (0.5, 0.5, 0.0)) * extent, _OUTWARD, _paint(random), place)


def _screen(random: np.random.Generator, size: FloatArray) -> SceneObject:
    """A folded paper screen, both sides of which reflect."""
    steps = np.sort(random.uniform(0.1, 0.9, 3))
    points = [[x * size[0], size[1] * random.uniform(0.3, 0.7)] for x in steps]
    height = random.uniform(0.8, 0.8 * size[2])
    vertices: list[list[float]] = []
    faces: list[tuple[int, ...]] = []
    for (ax, ay), (bx, by) in pairwise(points):
        first = len(vertices)
        vertices += [[ax, ay, 0.0], [bx, by, 0.0], [bx, by, height], [ax, ay, height]]
        faces.append((first, first + 1, first + 2, first + 3))
    return _shape("screen", np.array(vertices), tuple(faces), _paint(random, two_sided=True))


def _lamp(random: np.random.Generator, name: str, size: FloatArray) -> SceneObject:
    """A luminous panel that looks down, or a luminous box."""
    extent = random.uniform(0.05, 1.0, 2)
    spot = random.uniform((0.02, 0.02), np.maximum(size[:2] - extent - 0.02, 0.03))
    below = random.uniform(0.005, _LOW_LIGHT) if random.random() < 0.5 else random.uniform(0.1, 0.6 * size[2])
    material = Material(np.zeros(3), random.uniform(5.0, 60.0) * random.uniform(0.7, 1.0, 3))
    low = np.array([*spot, size[2] - below])
    if random.random() < 0.3:
        thick = min(0.05, 0.5 * below)
        vertices = low + (_CUBE - (0.0, 0.0, 1.0)) * np.array([*extent, thick])
        return _shape(name, vertices, _OUTWARD, material)
    vertices = low + _CUBE * np.array([*extent, 0.0])
    return _shape(name, vertices, ((0, 2, 3, 1),), material)
