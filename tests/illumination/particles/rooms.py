"""Small scenes for particles, and walks in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.illumination.particles.lights import VirtualLights
from solver.illumination.particles.path_numbers import PathPoints
from solver.illumination.particles.walk import ParticleWalk, WalkSettings
from solver.types import FloatArray, Points
from solver.visibility.rays import RayScene

CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
INWARD = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6))
"""Faces of CUBE seen from inside: z = 0, z = 1, x = 0, x = 1, y = 0, y = 1."""

Triple: TypeAlias = float | Sequence[float]
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


@dataclass(frozen=True, eq=False)
class Room:
    """A scene with its rays."""

    surfaces: Surfaces
    rays: RayScene

    def block(
        self, count: int, seed: int = 0, first: int = 0, settings: WalkSettings | None = None
    ) -> VirtualLights:
        """The lights of a block of paths."""
        chosen = settings or WalkSettings()
        return ParticleWalk(
            self.surfaces, self.rays, WalkSettings(chosen.points, chosen.absorb_at_random, seed)
        ).block(first, count)


def room_of(scene: Scene) -> Room:
    """A scene that can be walked in."""
    surfaces = flatten(scene)
    return Room(surfaces, RayScene(surfaces.triangles, surfaces.center, surfaces.size))


def room(*objects: SceneObject) -> Room:
    """The same of some objects."""
    return room_of(Scene(objects={o.id: o for o in objects}))


def cube(*walls: Material) -> Room:
    """The unit cube seen from inside, one object a face in INWARD's order; one material may do for all."""
    each = walls if len(walls) == len(INWARD) else walls * len(INWARD)
    return room(*(SceneObject(f"face{k}", Mesh(CUBE, (INWARD[k],)), each[k]) for k in range(len(INWARD))))


GREY, LAMP = material(0.5), material(0.5, 1.0)
CEILING_LIGHT = cube(GREY, LAMP, GREY, GREY, GREY, GREY)

UNBIASED = [
    WalkSettings(PathPoints.SCRAMBLED),
    WalkSettings(PathPoints.RANDOM),
    WalkSettings(PathPoints.SCRAMBLED, absorb_at_random=True),
    WalkSettings(PathPoints.RANDOM, absorb_at_random=True),
]
"""The ways to walk that are right in the mean for any number of paths."""


def label(settings: WalkSettings) -> str:
    """What a test calls a way to walk."""
    return settings.points.value + ("_absorbed" if settings.absorb_at_random else "")


def scatter(estimates: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Mean of independent estimates and its standard error."""
    found = np.array(estimates)
    return found.mean(axis=0), found.std(axis=0, ddof=1) / math.sqrt(len(found))
