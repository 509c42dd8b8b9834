"""Rooms whose furniture comes and goes."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from solver.engine.world import World
from solver.geometry.scene import Scene, SceneObject
from solver.geometry.transform import Transform
from solver.redistribution.redistribution import Redistribution
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray, Vector
from tests.transport.solving import box

S = TypeVar("S", bound=RadiositySolver)

SETTINGS: Final = SolverSettings(error_tolerance=0.05)


def room(reflectance: float | tuple[float, float, float] = 0.5, emission: float = 10.0) -> Scene:
    """A closed room with a lamp below the ceiling."""
    walls = box("walls", reflectance, high=(4.0, 3.0, 2.5))
    lamp = box("lamp", 0.0, emission, (1.6, 1.2, 2.35), (2.4, 1.8, 2.4), inward=False)
    return Scene(objects={"walls": walls, "lamp": lamp})


def crate(
    name: str, at: Vector | tuple[float, float, float], size: float = 0.5, reflectance: float = 0.6
) -> SceneObject:
    """A box with its lowest corner at a point, in metres."""
    made = box(name, reflectance, high=(size, size, size), inward=False)
    return replace(made, transform=placed(at))


def placed(at: Vector | tuple[float, float, float]) -> Transform:
    """The transform that puts an object's origin at a point."""
    matrix = np.eye(4)
    matrix[:3, 3] = at
    return Transform(matrix)


def fresh(scene: Scene, settings: SolverSettings = SETTINGS) -> RadiositySolver:
    """A solver that knows nothing but the scene."""
    world = World.of(scene)
    return RadiositySolver(world.surfaces, world.rays, settings)


def edited(before: RadiositySolver, scene: Scene, number: int = 1, drags: bool = False) -> Redistribution:
    """The solver of `scene` that goes on from what was before."""
    world = World.of(scene)
    return Redistribution(world.surfaces, world.rays, before.settings, before, number, drags)


def settled(solver: S) -> S:
    """The solver, when it has done all it can."""
    while solver.step(10.0):
        pass
    return solver


def patch_means(solver: RadiositySolver) -> FloatArray:
    """(p, 3) mean radiosity of every patch, W/m2."""
    field = solver.field()
    flux = np.zeros((solver.surfaces.patch_count, 3))
    np.add.at(flux, field.patch, field.radiosity * field.area[:, None])
    return np.asarray(flux / solver.surfaces.area[:, None])


def difference(one: RadiositySolver, other: RadiositySolver) -> float:
    """Relative RMS difference of the light that patches reflect."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    a, b = ((patch_means(solver) - solver.surfaces.emission) @ weights for solver in (one, other))
    area = one.surfaces.area
    scale = float((area * b**2).sum())
    off = float((area * (a - b) ** 2).sum())
    return float(np.sqrt(off / scale)) if scale > 0.0 else float(off > 0.0)
