"""The radiosity field: what a solve hands to whoever draws, probes or measures it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from solver.types import Corners, FloatArray, IntArray


class SolveOutcome(Enum):
    """How a solve stands; the value is what to tell the user."""

    RUNNING = "The solution is being refined."
    CONVERGED = "The estimated error is within the tolerance."
    ELEMENT_LIMIT = (
        "The element limit was reached before the tolerance: raise max_elements or error_tolerance."
    )
    LINK_LIMIT = "The link limit was reached before the tolerance: raise max_links or error_tolerance."
    TRANSPORT_ERROR = (
        "No link errs by more than transport_error, but the field does by more than error_tolerance: "
        "lower transport_error."
    )
    RELATIVE_CUTOFF = (
        "More radiosity is left unshot than error_tolerance allows, but no more than relative_cutoff: "
        "lower relative_cutoff."
    )
    MINIMUM_AREA = "Every element that needs refinement has the minimum area: lower minimum_area."


@dataclass(frozen=True, eq=False)
class RadiosityField:
    """A snapshot of the leaf elements and their radiosities; n leaves.

    Leaves of one patch tile it without overlap; neighbours may differ in size, and vertices that two
    leaves of a patch share are bit-identical.
    """

    corners: Corners
    """(n, 4, 3) metres, counter-clockwise from the front; a triangle repeats its last corner"""
    corner_count: IntArray
    """(n,) 3 or 4"""
    patch: IntArray
    """(n,) index into the surfaces' patches"""
    area: FloatArray
    """(n,) m2"""
    radiosity: FloatArray
    """(n, 3) W/m2, mean over the leaf, emission included"""
    irradiance: FloatArray
    """(n, 3) W/m2, mean over the leaf"""
