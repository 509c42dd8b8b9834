"""What the kernels know of a scene: its surfaces as they shade, and its emitters as they are sampled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.pathtracing.lobes import Lobes, build_lobes
from solver.types import FloatArray, IntArray
from solver.visibility.rays import RayScene


class ShadingTables(NamedTuple):
    """Lookups by triangle (t) and by patch (p), in world metres."""

    anchor: FloatArray
    """(t, 3) a corner of each triangle"""
    facing: FloatArray
    """(t, 3) unit normal of the front of each triangle"""
    triangle_patch: IntArray
    """(t, 2) patch on the front and on the back, -1 where black"""
    normal: FloatArray
    """(p, 3) unit"""
    reflectance: FloatArray
    """(p, 3)"""
    emission: FloatArray
    """(p, 3) W/m2"""
    density: FloatArray
    """(p,) probability per m2 that emitter sampling gives to each point of a patch"""
    offset: float
    """Metres by which vertices and shadow targets are lifted off their surfaces"""
    lobes: Lobes | None
    """What is not diffuse; None where all is"""


class Emitters(NamedTuple):
    """Triangles of the emitting patches, to be sampled by power times area; e triangles."""

    cumulative: FloatArray
    """(e + 1,) from 0 to 1; empty scenes of light have e = 0"""
    corner: FloatArray
    """(e, 3) first corner"""
    first_edge: FloatArray
    """(e, 3) to the second corner"""
    second_edge: FloatArray
    """(e, 3) to the third corner"""
    patch: IntArray
    """(e,)"""


def split_corners(corners: FloatArray, corner_count: IntArray) -> tuple[FloatArray, IntArray]:
    """Triangles (m, 3, 3) of planar convex quadrilaterals and triangles (n, 4, 3), and the owner of each."""
    owner = np.arange(len(corner_count), dtype=np.int32)
    quads = owner[corner_count == 4]
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[quads][:, [0, 2, 3]]])
    owners = np.concatenate([owner, quads])
    order = np.argsort(owners, kind="stable")
    return triangles[order], owners[order]


def build_tables(surfaces: Surfaces, rays: RayScene) -> tuple[ShadingTables, Emitters]:
    """The tables of a scene. Emitted power is weighed by the mean of its channels."""
    # Emitters: probability proportional to power; within a patch uniform over its area.
    power = surfaces.emission.mean(axis=1)
    shining = np.flatnonzero(power > 0.0)
    triangles, owner = split_corners(surfaces.corners[shining], surfaces.corner_count[shining])
    patch = shining[owner].astype(np.int32)
    edges = triangles[:, 1:] - triangles[:, :1]
    weight = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=-1) * power[patch]
    total = float(weight.sum())
    cumulative = np.zeros(len(weight) + 1)
    if total > 0.0:
        cumulative[1:] = np.cumsum(weight) / total
        cumulative[-1] = 1.0
    emitters = Emitters(
        cumulative=cumulative,
        corner=np.ascontiguousarray(triangles[:, 0]),
        first_edge=np.ascontiguousarray(edges[:, 0]),
        second_edge=np.ascontiguousarray(edges[:, 1]),
        patch=patch,
    )

    # Triangles take the normal of the patch on their front, not their own rounding of it.
    tables = ShadingTables(
        anchor=np.ascontiguousarray(surfaces.triangles[:, 0]),
        facing=np.ascontiguousarray(surfaces.normal[surfaces.triangle_patch[:, 0]]),
        triangle_patch=np.ascontiguousarray(surfaces.triangle_patch),
        normal=np.ascontiguousarray(surfaces.normal),
        reflectance=np.ascontiguousarray(surfaces.reflectance),
        emission=np.ascontiguousarray(surfaces.emission),
        density=power / total if total > 0.0 else np.zeros(len(power)),
        offset=rays.offset / rays.scale,
        lobes=build_lobes(surfaces),
    )
    return tables, emitters
