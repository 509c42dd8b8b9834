"""Irradiance as height over a surface: the arbitrary mapping of graphs and samples ([H B.4.7])."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.engine.overlays.base import Subject
from solver.types import FloatArray, IntArray, Points

_TALLEST: Final = 0.25
"""Height of the brightest triangle's mean over the diameter of the smallest square as large as its patch."""


def height_scale(subject: Subject, triangles: IntArray, given: float | None) -> float:
    """Metres for a W/m2: `given`, or so that what is shown of `triangles` (m,) stands out, and no more."""
    if given is not None:
        return given
    brightest = float(subject.interpolants().mean_luminance()[triangles].max(initial=0.0))
    patch = subject.interpolants().triangulation.patch[triangles]
    width = float(np.sqrt(subject.world.surfaces.area[patch].max(initial=0.0)))
    return _TALLEST * width / brightest if brightest > 0.0 else 0.0


def lifted(subject: Subject, position: Points, patch: IntArray, height: FloatArray) -> Points:
    """Positions (n, 3) on patches (n,) raised by heights (n,) m along the normal of the front."""
    return np.asarray(position + height[:, None] * subject.world.surfaces.normal[patch])
