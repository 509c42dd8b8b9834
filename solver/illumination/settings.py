"""What a user may set about fine light, beside the solve: parameters 4, 5 and 8 of [H appendix A], and more.

Needless here are parameter 6, the shortest backprojected segment, since visible parts are cut exactly
(`visible_parts`), and 9, the distance by which a source is pushed off its receiver: samples are taken from
inside of their triangle (`samples.NUDGE`, parameter 10), where the irradiance is finite and smooth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import StrEnum

from solver.transport.settings import SolverSettings


class Compensation(StrEnum):
    """How the light is found that bounded virtual lights leave out."""

    RAYS = "rays"
    """By short rays, and virtual lights where they end"""
    SOLUTION = "solution"
    """By short rays, and the radiosity solution where they end, as soon as there is one"""
    NONE = "none"
    """Not at all: corners are too dark"""


@dataclass(frozen=True)
class LightSettings(SolverSettings):
    """Parameters of a solve and of what is made of it."""

    interpolation_error: float | None = None
    """Relative RMS error of irradiance that interpolants may add to that of the solution, over what is in
    view; None: half of `error_tolerance`."""
    point_accuracy: float = 1e-3
    """Share of a point's irradiance that the treatment of one source may err by."""
    max_leaf_discontinuities: int = 10
    """[H A.5] Most sets of collinear discontinuities that cut one leaf."""
    minimum_discontinuity_weight: float | None = None
    """[H A.4] W/m2 of irradiance (luminance) that a quadratic over a leaf must be wrong by without a
    discontinuity for it to be meshed; None: derived from `interpolation_error` and the light in the scene."""
    max_triangles: int = 400_000
    """Triangles after which cells are not split any more."""
    vpl_reach: float = 0.2
    """Distance, in diameters of the scene, within which a virtual light is bounded; 0: nowhere."""
    vpl_compensation: Compensation = Compensation.RAYS
    """How what the bound takes away is put back."""
    vpl_resolution: int = 128
    """Texels along a side of the map of what a virtual light sees, 2 to 255."""
    max_paths: int = 65_536
    """Paths after which a frame by virtual lights is not improved any more."""

    @property
    def interpolation_tolerance(self) -> float:
        """`interpolation_error`, or what stands for it."""
        if self.interpolation_error is not None:
            return self.interpolation_error
        return 0.5 * self.error_tolerance

    @property
    def vpl_bound(self) -> float:
        """Of cos cos' / r^2 of a virtual light, with lengths in diameters of the scene: by `vpl_reach`."""
        return 1.0 / self.vpl_reach**2 if self.vpl_reach > 0.0 else math.inf

    def solves_as(self, other: LightSettings) -> bool:
        """Whether a solve by these is one by `other`."""
        return all(
            getattr(self, field.name) == getattr(other, field.name) for field in fields(SolverSettings)
        )
