"""Leaves and their vertices in the planes of their patches: what reconstruction goes by, light apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.faces import cross
from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.cells import Leaves
from solver.illumination.meshing.topology import Topology
from solver.kernels import kernel
from solver.parallel import core_count, run_chunks
from solver.types import BoolArray, FloatArray, IntArray

CHUNK: Final = 2048
"""Leaves or vertices below which a second thread is not worth its while."""


@dataclass(frozen=True, eq=False)
class PlanePoints:
    """n leaves with v vertices, in metres along two axes of each patch."""

    topology: Topology
    corner_count: IntArray
    """(n,) 3 or 4"""
    vertex: FloatArray
    """(v, 2)"""
    centroid: FloatArray
    """(n, 2) of leaves"""
    on_border: BoolArray
    """(v,) whether a vertex is on the border of its patch"""


def plane_points(leaves: Leaves, surfaces: Surfaces, topology: Topology) -> PlanePoints:
    """The points of `leaves`, whose connections are `topology`."""
    n, v = len(leaves.patch), len(topology.position)
    count = leaves.corner_count
    u_axis, v_axis = _axes(surfaces.normal)
    origin = surfaces.corners[:, 0]
    flat, centroid = np.empty((v, 2)), np.empty((n, 2))
    on_border = np.zeros(v, dtype=np.bool_)
    _mark_border(topology.border, topology.vertex, count, on_border)

    def work(start: int, stop: int) -> None:
        _flatten(
            start, stop, topology.vertex, count, topology.position, leaves.patch, origin, u_axis, v_axis,
            flat, centroid,
        )  # fmt: skip

    run_chunks(work, n, max(CHUNK, -(-n // core_count())))
    return PlanePoints(topology, count, flat, centroid, on_border)


def _axes(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors (p, 3) each that span the planes of unit normals (p, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    u = cross(helper, normal)
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    return u, cross(normal, u)


@kernel
def _mark_border(border: IntArray, vertex: IntArray, count: IntArray, on_border: BoolArray) -> None:
    for edge in border:
        leaf, k = edge >> 2, edge & 3
        on_border[vertex[leaf, k]] = True
        on_border[vertex[leaf, k + 1 if k + 1 < count[leaf] else 0]] = True


@kernel
def _flatten(
    start: int,
    stop: int,
    vertex: IntArray,
    count: IntArray,
    position: FloatArray,
    patch: IntArray,
    origin: FloatArray,
    u_axis: FloatArray,
    v_axis: FloatArray,
    flat: FloatArray,
    centroid: FloatArray,
) -> None:
    """Coordinates of vertices and centroids of leaves in the planes of their patches."""
    for leaf in range(start, stop):
        p = patch[leaf]
        for k in range(count[leaf]):
            i = vertex[leaf, k]
            u = 0.0
            v = 0.0
            for axis in range(3):
                d = position[i, axis] - origin[p, axis]
                u += d * u_axis[p, axis]
                v += d * v_axis[p, axis]
            flat[i, 0] = u
            flat[i, 1] = v
        # The centroid is the mean of the centroids of two triangles, weighted by area.
        a = vertex[leaf, 0]
        total = 0.0
        centroid[leaf, 0] = 0.0
        centroid[leaf, 1] = 0.0
        for k in range(1, count[leaf] - 1):
            b = vertex[leaf, k]
            c = vertex[leaf, k + 1]
            doubled = (flat[b, 0] - flat[a, 0]) * (flat[c, 1] - flat[a, 1]) - (flat[b, 1] - flat[a, 1]) * (
                flat[c, 0] - flat[a, 0]
            )
            total += doubled
            for axis in range(2):
                centroid[leaf, axis] += doubled * (flat[a, axis] + flat[b, axis] + flat[c, axis]) / 3.0
        centroid[leaf, 0] /= total
        centroid[leaf, 1] /= total
