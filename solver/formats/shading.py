"""What other formats say of surfaces and lights, in the terms of this project's materials.

Sources: the equivalence of roughness and the exponent of Blinn's model is Walter et al., *Microfacet models
for refraction through rough surfaces*, 2007; a lobe about the mirrored direction is as wide with a quarter of
that exponent, since half vectors turn by half the angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.document.fields import MAX_EMISSION, MAX_EXPONENT
from solver.document.models import MaterialDocument
from solver.types import FloatArray, Vector

MOST_REFLECTANCE: Final = 0.95
"""Of a channel, diffuse and specular together: files say 1 where they mean white."""

_MIRROR: Final = 1e-3
"""Slopes of a microfacet surface below this are those of a mirror."""

_DIFFUSE_EXPONENT: Final = 1.0
"""Lobes of no more than this are as good as diffuse."""


@dataclass(frozen=True, eq=False)
class Shade:
    """A surface in the making: numbers as a file gives them, which may be more than a surface can reflect."""

    diffuse: Vector
    """(3,) hemispherical reflectance"""
    emission: Vector
    """(3,) W/m2"""
    specular: Vector
    """(3,) hemispherical reflectance"""
    exponent: float = math.inf
    """Phong exponent, infinite for a mirror"""
    two_sided: bool = False
    emission_exponent: float = 0.0

    @staticmethod
    def matt(diffuse: FloatArray, emission: FloatArray | None = None, two_sided: bool = False) -> Shade:
        """A diffuse surface of reflectance (3,) and exitance (3,) W/m2."""
        return Shade(diffuse, np.zeros(3) if emission is None else emission, np.zeros(3), two_sided=two_sided)

    @property
    def out_of_bounds(self) -> list[str]:
        """What `document` has to change."""
        total = self.diffuse + self.specular
        told = []
        if total.max() > MOST_REFLECTANCE:
            told.append(f"what reflects more than {MOST_REFLECTANCE:g} of a channel is made to reflect that")
        if self.emission.max() > MAX_EMISSION:
            told.append(f"what emits more than {MAX_EMISSION:g} W/m2 of a channel is made to emit that")
        if min(self.diffuse.min(), self.specular.min(), self.emission.min()) < 0.0:
            told.append("what is negative of a material is taken as 0")
        return told

    def document(self) -> MaterialDocument:
        """The material, its channels brought into bounds where they are not."""
        diffuse, specular = np.maximum(self.diffuse, 0.0), np.maximum(self.specular, 0.0)
        share = np.minimum(1.0, MOST_REFLECTANCE / np.maximum(diffuse + specular, MOST_REFLECTANCE))
        return MaterialDocument(
            reflectance=(diffuse * share).tolist(),
            emission=self.emission.clip(0.0, MAX_EMISSION).tolist(),
            specular=(specular * share).tolist(),
            exponent=None if math.isinf(self.exponent) else min(self.exponent, MAX_EXPONENT),
            emission_exponent=self.emission_exponent,
            two_sided=self.two_sided,
        )


def exitance_of_luminance(luminance: FloatArray, efficacy: float) -> FloatArray:
    """Radiant exitance W/m2 of a diffuse emitter of `luminance` cd/m2, channel by channel; lm/W."""
    return np.asarray(math.pi * luminance / efficacy)


def phong_exponent(slope: float) -> float:
    """Phong exponent of a microfacet surface of RMS slope `slope` (glTF's roughness squared, MGF's alpha)."""
    if slope <= _MIRROR:
        return math.inf
    return max(0.0, 0.25 * (2.0 / slope**2 - 2.0))


def is_nearly_diffuse(exponent: float) -> bool:
    """Whether a lobe is so broad that it is taken as diffuse, which radiosity can show."""
    return exponent <= _DIFFUSE_EXPONENT
