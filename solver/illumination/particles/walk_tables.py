"""What the kernels of a walk read and write: the scene as it reflects, and the particles under way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.types import Corners, FloatArray, IntArray


class Tables(NamedTuple):
    """What kernels know of a scene: lookups by triangle (t) and by patch (p), in world metres."""

    anchor: FloatArray
    """(t, 3) a corner of each triangle"""
    facing: FloatArray
    """(t, 3) unit normal of the front of each triangle"""
    triangle_patch: IntArray
    """(t, 2) patch on the front and on the back, -1 where black"""
    corners: Corners
    """(p, 4, 3)"""
    normal: FloatArray
    """(p, 3) unit"""
    reflectance: FloatArray
    """(p, 3) diffuse"""
    specular: FloatArray
    """(p, 3)"""
    exponent: FloatArray
    """(p,) of the Phong lobe; infinite for mirrors"""
    emission_exponent: FloatArray
    """(p,)"""
    offset: float
    """Metres by which rays begin off their surface"""

    @staticmethod
    def of(surfaces: Surfaces, offset: float) -> Tables:
        """The tables of a scene."""
        # Triangles take the normal of the patch on their front, not their own rounding of it.
        return Tables(
            anchor=np.ascontiguousarray(surfaces.triangles[:, 0]),
            facing=np.ascontiguousarray(surfaces.normal[surfaces.triangle_patch[:, 0]]),
            triangle_patch=np.ascontiguousarray(surfaces.triangle_patch),
            corners=np.ascontiguousarray(surfaces.corners),
            normal=np.ascontiguousarray(surfaces.normal),
            reflectance=np.ascontiguousarray(surfaces.reflectance),
            specular=np.ascontiguousarray(surfaces.specular),
            exponent=np.ascontiguousarray(surfaces.exponent),
            emission_exponent=np.ascontiguousarray(surfaces.emission_exponent),
            offset=offset,
        )


class Particles(NamedTuple):
    """Where the particles of n paths are, and what they carry."""

    position: FloatArray
    """(n, 3) metres, on a surface"""
    normal: FloatArray
    """(n, 3) of that surface"""
    incident: FloatArray
    """(n, 3) unit direction of arrival; 0 on emitters"""
    carried: FloatArray
    """(n, 3) W that leave the surface if this path stands for all"""
    lobe: FloatArray
    """(n,) exponent of the lobe in which they do"""
    patch: IntArray
    """(n,)"""
    origin: FloatArray
    """(n, 3) where the next ray begins"""
    direction: FloatArray
    """(n, 3) unit"""

    @staticmethod
    def allocate(count: int) -> Particles:
        """Room for `count` particles."""
        return Particles(
            position=np.zeros((count, 3)),
            normal=np.zeros((count, 3)),
            incident=np.zeros((count, 3)),
            carried=np.zeros((count, 3)),
            lobe=np.ones(count),
            patch=np.zeros(count, dtype=np.int32),
            origin=np.zeros((count, 3)),
            direction=np.zeros((count, 3)),
        )
