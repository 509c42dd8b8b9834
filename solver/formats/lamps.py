"""Lights without a shape, given one: small surfaces that emit what the light does."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.formats.building import SceneBuilder
from solver.formats.shading import Shade
from solver.types import FloatArray, Points, Vector

BULB: Final = 0.02
"""Metres, the radius of a lamp, where the scene is not too small or too large for it."""

_LARGEST: Final = 0.01
_SMALLEST: Final = 0.0005
"""Radius of a lamp over the scene's size, at most and at least."""

SUN_DISTANCE: Final = 10.0
"""Distance of a distant lamp, in sizes of the scene from its middle."""

SUN_ANGLE: Final = math.radians(1.5)
"""Half of the angle that a distant lamp takes up, radians; the sun's is a sixth of that."""


def lamp_radius(builder: SceneBuilder) -> float:
    """Metres, for the scene as it has been built so far."""
    return float(np.clip(BULB, _SMALLEST * builder.size, _LARGEST * builder.size))


def quadrilateral(
    center: Vector, axis: Vector, width: float, length: float
) -> tuple[Points, list[list[int]]]:
    """A rectangle about `center` (3,) that faces along `axis` (3,): vertices (4, 3) and its face."""
    u, v = across(axis)
    u, v = 0.5 * width * u, 0.5 * length * v
    return np.stack([center - u - v, center + u - v, center + u + v, center - u + v]), [[0, 1, 2, 3]]


def across(axis: Vector) -> tuple[Vector, Vector]:
    """Unit vectors u, v (3,) with u x v along `axis`; u is as horizontal in x as it can be."""
    n = axis / np.linalg.norm(axis)
    helper = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    u = helper - (helper @ n) * n
    u /= np.linalg.norm(u)
    return u, np.cross(n, u)


def icosahedron(center: Vector, radius: float) -> tuple[Points, list[list[int]]]:
    """A ball of twenty triangles, whose intensity varies by 5 % with direction: vertices (12, 3), faces."""
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    corners = [(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    places = np.array([np.roll(corner, k) for k in range(3) for corner in corners])
    faces = []
    for i in range(12):
        for j in range(i + 1, 12):
            for k in range(j + 1, 12):
                sides = places[[i, j, k]] - places[[j, k, i]]
                if np.allclose((sides**2).sum(axis=1), 4.0):
                    outward = np.linalg.det(places[[i, j, k]]) > 0.0
                    faces.append([i, j, k] if outward else [i, k, j])
    return center + radius * places / math.sqrt(1.0 + golden**2), faces


def area_of(vertices: Points, faces: list[list[int]]) -> float:
    """m2 of convex planar faces."""
    total = 0.0
    for face in faces:
        places = vertices[face]
        doubled = np.cross(places[1:-1] - places[0], places[2:] - places[0]).sum(axis=0)
        total += 0.5 * float(np.linalg.norm(doubled))
    return total


def lamp(emission: FloatArray, exponent: float = 0.0) -> Shade:
    """A black surface of exitance (3,) W/m2, whose radiance goes with cos^exponent."""
    black = np.zeros(3)
    return Shade(black, emission, black, emission_exponent=exponent)
