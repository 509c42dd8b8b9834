"""What is not diffuse: the lobes into which surfaces reflect and emit.

Specular reflection is the modified Phong model (Lafortune and Willems 1994, *Using the modified Phong
reflectance model for physically based rendering*), with a the angle to the mirrored direction:

    f = rho_d / pi + rho_s (n + 2) / (2 pi) cos^n a,    0 where a is beyond a right angle.

It is reciprocal, and the lobe reflects rho_s of what comes in along the normal, less of all else: some of
the lobe is then below the surface, and f knows no 1 / cos that would make up for the slant. A narrow lobe
reflects rho_s times the cosine of incidence. A perfect mirror, of infinite n, is therefore not the limit of
lobes: it reflects rho_s at every angle.

Emission E has radiance E (d + 2) / (2 pi) cos^d of the angle to the normal, which is E / pi for d = 0.

A scene that is diffuse throughout has None for lobes. To the compiler None is a type, and what hangs on
it is decided before the machine code is made: such a scene runs code that knows nothing of lobes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import inline_kernel
from solver.types import BoolArray, FloatArray


class Lobes(NamedTuple):
    """Lookups by patch (p)."""

    specular: FloatArray
    """(p, 3) hemispherical specular reflectance"""
    exponent: FloatArray
    """(p,) n; infinite for a perfect mirror"""
    emission_exponent: FloatArray
    """(p,) d"""
    reflects: BoolArray
    """(p,) whether anything is reflected specularly"""


def build_lobes(surfaces: Surfaces) -> Lobes | None:
    """The lobes of a scene, or None where all is diffuse."""
    if not (surfaces.has_specular or surfaces.has_directional_emission):
        return None
    return Lobes(
        specular=np.ascontiguousarray(surfaces.specular),
        exponent=np.ascontiguousarray(surfaces.exponent),
        emission_exponent=np.ascontiguousarray(surfaces.emission_exponent),
        reflects=np.asarray(surfaces.specular.any(axis=1)),
    )


@inline_kernel
def reflects_specularly(lobes: Lobes | None, patch: int) -> bool:
    """Whether a patch reflects anything specularly."""
    if lobes is None:
        return False
    reflects: bool = lobes.reflects[patch]
    return reflects


@inline_kernel
def emission_lobe(lobes: Lobes | None, patch: int, along: float, squared: float) -> float:
    """Radiance that a patch emits over that of a diffuse emitter of the same exitance.

    `along` is the component to its normal, more than 0, of a vector whose length squared is `squared`.
    """
    if lobes is None:
        return 1.0
    exponent = lobes.emission_exponent[patch]
    if exponent == 0.0:
        return 1.0
    cosine = min(along / math.sqrt(squared), 1.0)
    lobe: float = 0.5 * (exponent + 2.0) * cosine**exponent
    return lobe


@inline_kernel
def phong_lobe(exponent: float, cosine: float) -> float:
    """pi f / rho_s of a lobe, `cosine` being that of the angle to the mirrored direction; 0 for a mirror."""
    if cosine <= 0.0 or math.isinf(exponent):
        return 0.0
    lobe: float = 0.5 * (exponent + 2.0) * min(cosine, 1.0) ** exponent
    return lobe


@inline_kernel
def specular_chance(exponent: float, specular: float, diffuse: float) -> float:
    """Probability to follow the lobe, or the mirror, where it and the rest are worth that much.

    Cosine-distributed directions meet a wide lobe as well as its own do, of n = 0 exactly: they are enough.
    """
    if math.isinf(exponent):
        return specular / (specular + diffuse)
    return specular / (specular + diffuse) * exponent / (exponent + 1.0)


@inline_kernel
def mirrored(dx: float, dy: float, dz: float, nx: float, ny: float, nz: float) -> tuple[float, float, float]:
    """The direction d of a ray after the mirror of unit normal n."""
    twice = 2.0 * (dx * nx + dy * ny + dz * nz)
    return dx - twice * nx, dy - twice * ny, dz - twice * nz
