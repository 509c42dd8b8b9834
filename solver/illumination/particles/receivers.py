"""Points that virtual lights shine on, laid out for the kernel that lights them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import Float32Array, FloatArray, IntArray, Points, Vector

_CHUNK: Final = 1 << 14
"""Receivers of a piece of work"""


@dataclass(frozen=True, eq=False)
class Polygons:
    """The q opaque polygons of a scene in local coordinates: centred, and a diameter of 1 in size."""

    surfaces: Surfaces
    of_triangle: IntArray
    """(t,) polygon of each opaque triangle, from 1"""
    of_patch: IntArray
    """(p,) polygon that a patch is a side of, from 1"""
    corners: Float32Array
    """(q + 1, 4, 3) local; a triangle repeats its last corner. Polygon 0 stands for nothing"""
    plane: Float32Array
    """(q + 1, 4) unit normal, and its product with any point of the polygon"""

    @classmethod
    def of(cls, surfaces: Surfaces) -> Polygons:
        """The polygons of `surfaces`: its front patches, which have the same corners."""
        front, back = surfaces.triangle_patch.T
        number = np.zeros(surfaces.patch_count, dtype=np.int32)
        fronts = np.unique(front)
        number[fronts] = np.arange(1, len(fronts) + 1, dtype=np.int32)
        double = back >= 0
        number[back[double]] = number[front[double]]
        corners = np.zeros((len(fronts) + 1, 4, 3))
        corners[1:] = local(surfaces, surfaces.corners[fronts])
        plane = np.zeros((len(fronts) + 1, 4))
        plane[1:, :3] = surfaces.normal[fronts]
        plane[:, 3] = np.einsum("qa,qa->q", plane[:, :3], corners.mean(axis=1))
        return cls(surfaces, number[front], number, corners.astype(np.float32), plane.astype(np.float32))

    def __len__(self) -> int:
        return len(self.plane) - 1


@dataclass(frozen=True, eq=False)
class Receivers:
    """n points on patches; neighbours in the list should be neighbours in space."""

    frame: Float32Array
    """(6, n) local position, unit normal"""
    polygon: IntArray
    """(n,) polygon that a point lies on"""
    patch: IntArray
    """(n,) patch that is lit there"""

    @classmethod
    def on(cls, polygons: Polygons, positions: Points, patch: IntArray) -> Receivers:
        """Receivers at world `positions` (n, 3) on the lit side of `patch` (n,)."""
        surfaces = polygons.surfaces
        frame = np.empty((6, len(patch)), dtype=np.float32)
        polygon = np.empty(len(patch), dtype=np.int32)
        run_chunks(
            lambda start, stop: _place(
                start, stop, positions, patch, surfaces.normal, surfaces.center, surfaces.size,
                polygons.of_patch, frame, polygon,
            ),
            len(patch),
            _CHUNK,
        )  # fmt: skip
        return cls(frame, polygon, patch)

    def __len__(self) -> int:
        return len(self.patch)

    def take(self, chosen: IntArray) -> Receivers:
        """Those with the indices `chosen`, in that order."""
        return Receivers(
            np.ascontiguousarray(self.frame[:, chosen]), self.polygon[chosen], self.patch[chosen]
        )


def local(surfaces: Surfaces, points: Points) -> Points:
    """World points (..., 3) in local coordinates, as rays have them."""
    return np.asarray((points - surfaces.center) / surfaces.size)


@kernel
def _place(
    start: int,
    stop: int,
    positions: Points,
    patch: IntArray,
    normal: FloatArray,
    center: Vector,
    size: float,
    of_patch: IntArray,
    frame: Float32Array,
    polygon: IntArray,
) -> None:
    """The frames (6, n) and polygons (n,) of the receivers [start, stop)."""
    for i in range(start, stop):
        p = patch[i]
        polygon[i] = of_patch[p]
        for axis in range(3):
            frame[axis, i] = (positions[i, axis] - center[axis]) / size
            frame[3 + axis, i] = normal[p, axis]
