"""The leaves of a solution with all that they carry, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.engine.solution import Solution
from solver.engine.world import World
from solver.transport.elements import plane_axes
from solver.types import LUMINANCE_WEIGHTS, Corners, FloatArray, IntArray, Spectra


@dataclass(frozen=True, eq=False)
class Elements:
    """n leaves: they tile the patches, which are the faces of objects or pieces of these."""

    corners: Corners
    """(n, 4, 3) metres, counter-clockwise from the front; a triangle repeats its last corner"""
    corner_count: IntArray
    """(n,) 3 or 4"""
    patch: IntArray
    """(n,)"""
    object: IntArray
    """(n,) index into the ids of objects"""
    face: IntArray
    """(n,) of the object"""
    side: IntArray
    """(n,) 0 for the front of a face, 1 for the back of a two-sided one"""
    area: FloatArray
    """(n,) m2"""
    radiosity: Spectra
    """(n, 3) W/m2, mean, emission included"""
    irradiance: Spectra
    """(n, 3) W/m2, mean"""
    illuminance: FloatArray
    """(n,) lux, mean"""
    corner_irradiance: FloatArray
    """(n, 4, 3) W/m2 by the linear function of the element"""
    corner_radiosity: FloatArray
    """(n, 4, 3) W/m2"""


def elements_of(world: World, solution: Solution) -> Elements:
    """The leaves of `solution` as it stands."""
    field, surfaces = solution.field(), world.surfaces
    patch = field.patch
    at_corners = _at_corners(solution, field.irradiance, patch)
    emission, reflectance = surfaces.emission[patch], surfaces.reflectance[patch]
    return Elements(
        corners=field.corners,
        corner_count=field.corner_count,
        patch=patch,
        object=surfaces.object[patch],
        face=surfaces.face[patch],
        side=surfaces.side[patch],
        area=field.area,
        radiosity=field.radiosity,
        irradiance=field.irradiance,
        illuminance=world.scene.luminous_efficacy * (field.irradiance @ LUMINANCE_WEIGHTS),
        corner_irradiance=at_corners,
        corner_radiosity=emission[:, None] + reflectance[:, None] * at_corners,
    )


def _at_corners(solution: Solution, mean: Spectra, patch: IntArray) -> FloatArray:
    """(n, 4, 3) the linear functions of leaves with the means `mean` at their corners; not negative."""
    state = solution.solver.state
    tree, leaves = state.tree, state.tree.leaves
    axes = plane_axes(state.surfaces.normal)[patch]
    away = tree.corners[leaves] - tree.centroid[leaves][:, None]
    places = np.einsum("nkc,nac->nka", away, axes)
    slopes = state.received[leaves, 1:]
    # One channel stands for all three in a grey scene.
    rise = np.einsum("nka,nac->nkc", places, slopes)
    return np.asarray(np.maximum(mean[:, None] + rise, 0.0))
