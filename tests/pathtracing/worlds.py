"""Small scenes with a known answer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from solver.engine.world import World
from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.pathtracing import PathTracer
from solver.types import FloatArray, Points

CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
INWARD = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6))
"""Faces of CUBE seen from inside: z = 0, z = 1, x = 0, x = 1, y = 0, y = 1."""
OUTWARD = tuple(face[::-1] for face in INWARD)

Triple: TypeAlias = float | Sequence[float] | FloatArray
"""One number for all channels, or three."""


def material(
    reflectance: Triple = 0.0,
    emission: Triple = 0.0,
    two_sided: bool = False,
    specular: Triple = 0.0,
    exponent: float = math.inf,
    emission_exponent: float = 0.0,
) -> Material:
    return Material(
        np.broadcast_to(reflectance, 3),
        np.broadcast_to(emission, 3),
        two_sided,
        np.broadcast_to(specular, 3),
        exponent,
        emission_exponent,
    )


def polygon(name: str, corners: Sequence[Sequence[float]] | Points, of: Material) -> SceneObject:
    """One face, counter-clockwise from its front."""
    return SceneObject(name, Mesh(np.array(corners, dtype=float), (tuple(range(len(corners))),)), of)


def square(
    name: str, of: Material, z: float, down: bool = False, low: float = 0.0, high: float = 1.0
) -> SceneObject:
    """An axis-parallel square at height z that faces up, or down."""
    corners = [[low, low, z], [high, low, z], [high, high, z], [low, high, z]]
    return polygon(name, corners[::-1] if down else corners, of)


def world(*objects: SceneObject) -> World:
    return World.of(Scene(objects={o.id: o for o in objects}))


def tracer(*objects: SceneObject, seed: int = 1) -> PathTracer:
    built = world(*objects)
    return PathTracer(built.surfaces, built.rays, seed)


def cube(reflectance: Sequence[float], emission: Sequence[float], seed: int = 1) -> PathTracer:
    """The unit cube seen from inside, one object a face."""
    return tracer(
        *(
            SceneObject(f"face{k}", Mesh(CUBE, (face,)), material(reflectance[k], emission[k]))
            for k, face in enumerate(INWARD)
        ),
        seed=seed,
    )
