"""What a user may set about the solve; everything but `error_tolerance` has a default derived from it.

These are parameters 1, 2 and 7 of [H appendix A]; parameter 3 (roundoff) is `solver.tolerances`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Interleaving(StrEnum):
    """What comes first after an edit: light that is redistributed, or light that is propagated."""

    REDISTRIBUTE_FIRST = "redistribute_first"
    """The object and its shadow first, what it changes elsewhere later ([G] strategy one)"""
    BY_ENERGY = "by_energy"
    """Whatever moves more energy ([G] strategy two)"""


class Saving(StrEnum):
    """Work that is left out where it would change nothing that counts."""

    CHANNELS = "channels"
    """A scene without colours is solved in one channel."""
    SHADOW_TESTS = "shadow_tests"
    """Pairs whose shaft holds no blocker, or is filled by one, are tested by no ray."""
    RAYS = "rays"
    """Links that matter little have their visibility told by few rays."""
    DISCONTINUITIES = "discontinuities"
    """Those that would not be seen are not meshed."""
    INTERPOLANTS = "interpolants"
    """What no camera sees gets none."""


@dataclass(frozen=True)
class SolverSettings:
    """Parameters of one radiosity solve."""

    error_tolerance: float = 0.02
    """Relative error that the solve aims at: area-weighted RMS luminance error of the element
    radiosities over their RMS luminance."""
    transport_error: float | None = None
    """[H A.1] Largest irradiance error in W/m2 (luminance) that one link may carry; None: derived
    from `error_tolerance` and the light in the scene."""
    minimum_area: float | None = None
    """[H A.2] Smallest area of an element in m2: one below four times as much is not subdivided; None:
    derived."""
    relative_cutoff: float | None = None
    """[H A.7] The iteration stops when the unshot radiosity is at most this fraction of what is
    reflected; None: derived."""
    interleaving: Interleaving = Interleaving.REDISTRIBUTE_FIRST
    """[G "Interleaving redistribution and propagation shots"] The order of work after an edit; where it
    leads to is the same."""
    in_full: tuple[Saving, ...] = ()
    """What is not saved, to see that it changes nothing and what it would cost."""
    max_elements: int = 400_000
    """Elements (leaves and inner nodes) after which refinement stops with a warning."""
    max_links: int = 6_000_000
    """Links after which refinement stops with a warning."""
