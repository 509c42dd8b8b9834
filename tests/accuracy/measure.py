"""How far a solve is from the path-traced witness, the witness's own noise taken off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.document.samples import load_sample
from solver.engine.world import World
from solver.pathtracing import PathTracer
from solver.transport.solve import RadiositySolver
from solver.types import LUMINANCE_WEIGHTS


@dataclass(frozen=True)
class Measured:
    """Relative errors of what the leaves reflect: area-weighted RMS of luminance [G eq. 7].

    Emission is left out of the norm, which is stricter than to leave it in.
    """

    error: float
    noise: float
    """of the witness"""


def sample(name: str) -> World:
    """A sample scene."""
    return World.of(load_sample(name))


def measure(world: World, solver: RadiositySolver, paths: int, seed: int = 5) -> Measured:
    """Error of the leaf radiosities against about `paths` traced paths over all leaves."""
    field = solver.field()
    each = max(1, paths // (32 * len(field.area))) * 32
    tracer = PathTracer(world.surfaces, world.rays, seed)
    truth, standard_error = tracer.mean_irradiance(field.corners, field.corner_count, field.patch, each)
    weight = world.surfaces.reflectance[field.patch] * LUMINANCE_WEIGHTS
    off = ((field.irradiance - truth) * weight).sum(axis=1)
    # Channels share their paths, so that their noise adds up by amplitude.
    noise = (standard_error * weight).sum(axis=1)
    norm = float(field.area @ (truth * weight).sum(axis=1) ** 2)
    squared = float(field.area @ (off**2 - noise**2)) / norm
    return Measured(float(np.sqrt(max(0.0, squared))), float(np.sqrt(field.area @ noise**2 / norm)))
