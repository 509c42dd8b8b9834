"""Luminous intensity over angles as directional emission: the same lumens, and the nearest power of a cosine.

An emitter of area A, exitance E and exponent d has the intensity A E (d + 2) / (2 pi) cos^(d+1) at an angle
to its normal, whatever its shape (docs/materials.md): its lumens are exact for every d, which alone is
fitted, by least squares over the hemisphere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.types import FloatArray

_TRIED: Final = np.concatenate([np.linspace(0.0, 4.0, 81), np.geomspace(4.2, 2e4, 400)])
"""Exponents that are tried: steps of 0.05, then of 2 %."""

_FINE: Final = 1001
"""Angles over a hemisphere at which a fit is weighed."""


@dataclass(frozen=True)
class Beam:
    """What goes into one hemisphere."""

    lumens: float
    exponent: float
    """d of directional emission"""
    error: float
    """Relative RMS error of the intensity over the hemisphere"""


def flux(angle: FloatArray, intensity: FloatArray) -> float:
    """Lumens of an intensity (n,) cd that is linear between angles (n,) radians from an axis, all around it.

    The integral of (a + b t) sin t has a closed form, which is summed over the pieces.
    """
    low, high = angle[:-1], angle[1:]
    slope = np.diff(intensity) / np.maximum(high - low, 1e-12)
    constant = intensity[:-1] - slope * low

    def antiderivative(t: FloatArray) -> FloatArray:
        return np.asarray(-constant * np.cos(t) + slope * (np.sin(t) - t * np.cos(t)))

    return 2.0 * math.pi * float((antiderivative(high) - antiderivative(low)).sum())


def fit_beam(angle: FloatArray, intensity: FloatArray, spread: FloatArray | None = None) -> Beam | None:
    """The beam of an intensity (n,) cd at angles (n,) from 0 up to pi / 2 radians; None for no light.

    `spread` (n,) is the standard deviation of the intensity around the axis, which no beam can follow.
    """
    lumens = flux(angle, intensity)
    if lumens <= 0.0:
        return None
    fine = np.linspace(0.0, 0.5 * math.pi, _FINE)
    measured = np.interp(fine, angle, intensity, right=0.0)
    around = np.zeros(_FINE) if spread is None else np.interp(fine, angle, spread, right=0.0)
    weight = np.sin(fine)
    cosine = np.cos(fine).clip(0.0)
    best, least = 0.0, math.inf
    for exponent in _TRIED.tolist():
        shape = lumens * (exponent + 2.0) / (2.0 * math.pi) * cosine ** (exponent + 1.0)
        wrong = float((weight * (measured - shape) ** 2).sum())
        if wrong < least:
            best, least = exponent, wrong
    total = float((weight * (measured**2 + around**2)).sum())
    error = math.sqrt((least + float((weight * around**2).sum())) / total)
    return Beam(lumens, best, error)
