"""The discontinuities of a solution: found, weighed by its light, and those that are meshed ([H 5.5.8])."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.illumination.discontinuity.activation import Activation, activate
from solver.illumination.discontinuity.discontinuities import Discontinuities, find_discontinuities
from solver.illumination.discontinuity.leaf_crossings import LeafCrossings, find_crossings
from solver.illumination.discontinuity.outlines import find_outlines
from solver.illumination.discontinuity.sets import DiscontinuitySets, group_discontinuities
from solver.illumination.meshing.cells import ConstraintEdges
from solver.illumination.settings import LightSettings
from solver.transport.field import RadiosityField
from solver.transport.pushpull import means
from solver.transport.settings import Saving
from solver.transport.state import TransportState
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from solver.visibility.bvh import Hierarchy

WEIGHT: Final = 0.5
"""A discontinuity is meshed if without it irradiance would be wrong by this times the tolerance, relative to
what the receiver and the scene have."""

_NO_LIMIT: Final = 256
"""Lines that a leaf may bear where none is left out"""

_SPREAD: Final = 0.2
"""RMS over a leaf, relative to its weight, of what a line does that is left out: it is wrong near it."""

_AT_ONCE: Final = 64
"""Receivers looked at between two yields."""


@dataclass(frozen=True, eq=False)
class Lines:
    """d discontinuities and what became of them."""

    discontinuities: Discontinuities
    sets: DiscontinuitySets
    weight: FloatArray
    """(d,) W/m2 of luminance; infinite for contacts"""
    hardt_weight: FloatArray
    """(d,) [H 5.3]"""
    activation: Activation
    edges: ConstraintEdges
    """What the triangulation must contain"""
    left_out: float
    """Relative RMS error of irradiance that quadratics may have for what is left out, by its weights"""


def find_lines(
    state: TransportState, hierarchy: Hierarchy, field: RadiosityField, settings: LightSettings
) -> Generator[None, None, Lines]:
    """The discontinuities that the light of `state` makes on the leaves of `field`; yields now and then.

    What emits counts as a source: the light of reflectors comes from all sides, and its shadows are soft;
    where they are not, at contacts, there is a line whatever the source.
    """
    surfaces = state.surfaces
    sources = np.flatnonzero(surfaces.emission.any(axis=1)).astype(np.int32)
    outlines = find_outlines(surfaces)
    yield
    parts = []
    for start in range(0, max(1, surfaces.patch_count), _AT_ONCE):
        receivers = np.arange(start, min(start + _AT_ONCE, surfaces.patch_count), dtype=np.int32)
        parts.append(find_discontinuities(surfaces, hierarchy, sources, receivers, outlines=outlines))
        yield
    found = Discontinuities.joined(parts)
    sets = group_discontinuities(surfaces, found)
    yield
    crossings = find_crossings(surfaces, sets, field)
    yield
    radiosity = means(state.tree, state.radiosity)[: state.tree.patch_count] @ state.weights
    weight = found.weights(radiosity, crossings.size)
    least, most = settings.minimum_discontinuity_weight, settings.max_leaf_discontinuities
    if Saving.DISCONTINUITIES in settings.in_full:
        least, most = 0.0, _NO_LIMIT
    if least is None:
        relative = weight / _scale(field, surfaces.patch_count)[found.receiver]
        least = WEIGHT * settings.interpolation_tolerance
        activation = activate(sets, crossings, relative, least, most)
    else:
        activation = activate(sets, crossings, weight, least, most)
    made = activation.edges
    return Lines(
        discontinuities=found,
        sets=sets,
        weight=weight,
        hardt_weight=found.hardt_weights(radiosity),
        activation=activation,
        edges=ConstraintEdges(made.patch, made.ends, made.set, made.jump),
        left_out=_left_out(crossings, weight, activation, field),
    )


def _left_out(
    crossings: LeafCrossings, weight: FloatArray, activation: Activation, field: RadiosityField
) -> float:
    """Relative RMS error of all irradiance if each leaf errs by the heaviest line that it is without."""
    entries = np.repeat(np.where(activation.active, 0.0, weight), np.diff(crossings.start))
    worst = np.zeros(crossings.leaf_count)
    np.maximum.at(worst, crossings.leaf, np.where(np.isfinite(entries), entries, 0.0))
    light = float(field.area @ (field.irradiance @ LUMINANCE_WEIGHTS) ** 2)
    return min(1.0, _SPREAD * float(np.sqrt(field.area @ worst**2 / light))) if light > 0.0 else 0.0


def _scale(field: RadiosityField, patches: int) -> FloatArray:
    """(p,) irradiance that errors on a patch are held against, W/m2: between its own and the scene's."""
    bright = field.irradiance @ LUMINANCE_WEIGHTS
    area: FloatArray = np.maximum(np.bincount(field.patch, field.area, patches), 1e-300)
    own = np.sqrt(np.bincount(field.patch, field.area * bright**2, patches) / area)
    whole = np.sqrt((field.area * bright**2).sum() / max(float(field.area.sum()), 1e-300))
    return np.asarray(np.maximum(np.sqrt(own * whole), 1e-12 * max(float(whole), 1e-300)))
