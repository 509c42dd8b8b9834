"""The measured error of a solution: against the path tracer, which shares nothing with it but the geometry.

The relative error is that of what leaves reflect, rho times irradiance: emission is known, and would only
flatter it. With b a solution, y the truth, and u, v two independent unbiased estimates of y,

    E[sum a (b - u)(b - v)] = sum a (b - y)^2    and    E[sum a u v] = sum a y^2

for leaf areas a: the paths' noise is not in the products, so that nothing has to be taken off for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.engine.world import World
from solver.pathtracing import PathTracer
from solver.transport.field import RadiosityField
from solver.types import LUMINANCE_WEIGHTS, FloatArray

_LEAST_SAMPLES: Final = 128
_MOST_SAMPLES: Final = 8192
"""Paths from a leaf for one estimate: enough to tell 1 % in the darkest scene, and no more than few need."""


@dataclass(frozen=True)
class MeasuredError:
    """Relative RMS error of the luminance that leaves reflect, weighted by area."""

    value: float
    standard_error: float
    """Of the value, from the spread over leaves"""

    def __str__(self) -> str:
        return f"{100.0 * self.value:.2f} ± {100.0 * self.standard_error:.2f} %"


def measured_error(world: World, field: RadiosityField, paths: int) -> MeasuredError:
    """The error of `field` against twice about `paths` paths, as many from each leaf."""
    samples = min(_MOST_SAMPLES, max(_LEAST_SAMPLES, paths // len(field.area)))
    surfaces = world.surfaces
    reflectance = surfaces.reflectance[field.patch]
    first, second = (
        (reflectance * _irradiance(world, field, samples, seed)) @ LUMINANCE_WEIGHTS for seed in (1, 2)
    )
    return error_of((reflectance * field.irradiance) @ LUMINANCE_WEIGHTS, first, second, field.area)


def error_of(found: FloatArray, first: FloatArray, second: FloatArray, area: FloatArray) -> MeasuredError:
    """The error of `found` (n,) against two independent estimates (n,) of the truth."""
    norm = float((area * first * second).sum())
    products = area * (found - first) * (found - second) / norm
    square = float(products.sum())
    spread = math.sqrt(float((products**2).sum()))
    # Of an error below its own noise only a bound is known.
    value = math.sqrt(max(square, 0.0))
    return MeasuredError(value, spread / (2.0 * max(value, math.sqrt(spread))))


def _irradiance(world: World, field: RadiosityField, samples: int, seed: int) -> FloatArray:
    tracer = PathTracer(world.surfaces, world.rays, seed)
    mean, _ = tracer.mean_irradiance(field.corners, field.corner_count, field.patch, samples)
    return np.asarray(mean)
