"""Balls, cylinders, cones, rings and prisms of MGF as polygons whose corners lie on them.

Polygons have a little less area than what they stand for; what emits makes up for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.formats.lamps import across
from solver.types import FloatArray, Points, Vector

AROUND: Final = 16
"""Sides of a circle."""
_ROWS: Final = 8
"""Rows of quadrilaterals from pole to pole of a ball."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Polygons in place of a curved surface."""

    vertices: Points
    faces: list[list[int]]
    area: float
    """m2 of the curved surface itself"""


def ball(center: Vector, radius: float) -> Solid:
    """A sphere; of a negative radius, seen from within."""
    polar = np.linspace(0.0, math.pi, _ROWS + 1)[1:-1]
    rings = [
        center + abs(radius) * (math.cos(t) * np.array([0.0, 0.0, 1.0]) + math.sin(t) * _circle(*_FLAT))
        for t in polar.tolist()
    ]
    poles = center + np.array([[0.0, 0.0, abs(radius)], [0.0, 0.0, -abs(radius)]])
    vertices = np.concatenate([*rings, poles])
    faces = []
    top, bottom = len(vertices) - 2, len(vertices) - 1
    last = (len(rings) - 1) * AROUND
    for k in range(AROUND):
        after = (k + 1) % AROUND
        faces.append([top, k, after])
        faces.append([bottom, last + after, last + k])
        for row in range(len(rings) - 1):
            above, below = row * AROUND, (row + 1) * AROUND
            faces.append([above + k, below + k, below + after, above + after])
    return _turned(Solid(vertices, faces, 4.0 * math.pi * radius**2), radius < 0.0)


def cone(first: Vector, radius: float, second: Vector, other: float) -> Solid | None:
    """The side of a cut cone, open at its ends; of negative radii, seen from within. None without length."""
    axis = second - first
    height = float(np.linalg.norm(axis))
    if height <= 0.0 or (radius == 0.0 and other == 0.0):
        return None
    circle = _circle(*across(axis))
    a, b = abs(radius), abs(other)
    vertices = np.concatenate([first + a * circle, second + b * circle])
    faces = []
    for k in range(AROUND):
        after = (k + 1) % AROUND
        face = [k, after, AROUND + after, AROUND + k]
        if a == 0.0:
            face = [k, AROUND + after, AROUND + k]
        elif b == 0.0:
            face = [k, after, AROUND + k]
        faces.append(face)
    area = math.pi * (a + b) * math.hypot(height, a - b)
    return _turned(Solid(vertices, faces, area), min(radius, other) < 0.0)


def ring(center: Vector, normal: Vector, inner: float, outer: float) -> Solid | None:
    """A disc, with a hole if `inner` is not 0, that faces along `normal`. None where nothing is left."""
    if not outer > inner >= 0.0 or float(np.linalg.norm(normal)) <= 0.0:
        return None
    circle = _circle(*across(normal))
    area = math.pi * (outer**2 - inner**2)
    if inner == 0.0:
        return Solid(center + outer * circle, [list(range(AROUND))], area)
    vertices = np.concatenate([center + inner * circle, center + outer * circle])
    faces = [[k, AROUND + k, AROUND + (k + 1) % AROUND, (k + 1) % AROUND] for k in range(AROUND)]
    return Solid(vertices, faces, area)


def prism(base: Points, length: float) -> Solid | None:
    """The closed solid that a polygon (n, 3) sweeps away from its normal, so that it faces outwards.

    By a negative length it sweeps the other way, and is seen from within. None where nothing is swept.
    """
    doubled = np.cross(base[1:-1] - base[0], base[2:] - base[0]).sum(axis=0)
    size = float(np.linalg.norm(doubled))
    if size <= 0.0 or length == 0.0:
        return None
    n = len(base)
    vertices = np.concatenate([base, base - length * doubled / size])
    face, opposite = list(range(n)), list(range(n, 2 * n))[::-1]
    sides = [[(k + 1) % n, k, n + k, n + (k + 1) % n] for k in range(n)]
    edges = np.roll(base, -1, axis=0) - base
    area = size + abs(length) * float(np.linalg.norm(edges, axis=1).sum())
    return Solid(vertices, [face, opposite, *sides], area)


_FLAT: Final = (np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))


def _circle(u: Vector, v: Vector) -> FloatArray:
    """(n, 3) points of the unit circle in the plane of u and v, counter-clockwise about u x v."""
    angle = np.arange(AROUND) * (2.0 * math.pi / AROUND)
    return np.asarray(np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)


def _turned(solid: Solid, is_inside: bool) -> Solid:
    if not is_inside:
        return solid
    return Solid(solid.vertices, [face[::-1] for face in solid.faces], solid.area)
