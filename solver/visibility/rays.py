"""Ray queries through Embree: the only module that imports embreex.

Embree sees float32. So that a scene of any size, anywhere, keeps its digits, it is given the scene in
local coordinates: centred, and scaled so that its bounding box has a diagonal of 1. Rays are spread
over all cores in chunks, since Embree releases the GIL.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from embreex import rtcore, rtcore_scene
from embreex.mesh_construction import TriangleMesh

from solver import tolerances
from solver.parallel import run_chunks
from solver.types import BoolArray, Float32Array, FloatArray, IntArray, Points, Vector

_LEAST: Final = 512
_FAR: Final = 1e37
CHUNK: Final = 16384
"""Rays per Embree call: large enough to hide the 9 us of a call, small enough to balance the cores."""


def embree_version() -> str:
    """The version of the Embree library, as it tells it."""
    return str(rtcore.EmbreeDevice()).removeprefix("Embree version:").strip()


@dataclass(frozen=True, eq=False)
class Hits:
    """What rays hit first."""

    triangle: IntArray
    """(n,) index of the triangle, or -1"""
    distance: FloatArray
    """(n,) in lengths of the ray's direction, infinite where nothing is hit"""


class RayScene:
    """Triangles that can be asked for occlusion and first hits."""

    def __init__(self, triangles: FloatArray, center: Vector, size: float) -> None:
        """Build Embree's hierarchy over `triangles` (t, 3, 3) of a scene of diameter `size` at `center`."""
        self.center = center
        self.scale = 1.0 / size
        self.offset = tolerances.RAY_OFFSET
        """Distance in local coordinates by which a ray's ends leave their surfaces."""
        self._empty = len(triangles) == 0
        self._device = rtcore.EmbreeDevice()
        self._scene = rtcore_scene.EmbreeScene(self._device)
        if not self._empty:
            TriangleMesh(self._scene, self.to_local(triangles))
            # The hierarchy is committed by the first query.
            self._scene.run(np.zeros((1, 3), "f4"), np.ones((1, 3), "f4"), query="OCCLUDED")

    def to_local(self, points: FloatArray) -> Float32Array:
        """World points (..., 3) in Embree's frame."""
        return np.ascontiguousarray((points - self.center) * self.scale, dtype=np.float32)

    def occluded_local(self, origins: Float32Array, directions: Float32Array) -> BoolArray:
        """Whether anything lies between `origins` and `origins + directions`, (n, 3) local float32 each.

        The ends must already be off their surfaces.
        """
        blocked = np.zeros(len(origins), dtype=np.bool_)
        if self._empty:
            return blocked
        unit = np.ones(min(CHUNK, len(origins)), dtype=np.float32)

        def query(start: int, stop: int) -> None:
            found = self._scene.run(
                origins[start:stop], directions[start:stop], dists=unit[: stop - start], query="OCCLUDED"
            )
            blocked[start:stop] = found >= 0

        run_chunks(query, len(origins), CHUNK, _LEAST)
        return blocked

    def occluded(self, origins: Points, targets: Points) -> BoolArray:
        """Whether anything lies strictly between world points, (n, 3) each."""
        start = self.to_local(origins)
        return self.occluded_local(start, self.to_local(targets) - start)

    def first_local(self, origins: Float32Array, directions: Float32Array, reach: float = _FAR) -> IntArray:
        """The first triangle (n,), or -1, from `origins` along `directions`, (n, 3) local float32 each.

        What is farther than `reach`, in lengths of the direction, is not seen.
        """
        triangle = np.full(len(origins), -1, dtype=np.int32)
        if self._empty:
            return triangle

        def query(start: int, stop: int) -> None:
            triangle[start:stop] = self._scene.run(
                origins[start:stop], directions[start:stop], dists=reach, query="INTERSECT"
            )

        run_chunks(query, len(origins), CHUNK, _LEAST)
        return triangle

    def intersect(self, origins: Points, directions: FloatArray, reach: float = np.inf) -> Hits:
        """The first triangle hit from `origins` along `directions` (n, 3), world coordinates.

        What is farther than `reach`, in lengths of the direction, is not seen.
        """
        triangle = np.full(len(origins), -1, dtype=np.int32)
        distance = np.full(len(origins), np.inf)
        if self._empty:
            return Hits(triangle, distance)
        local = self.to_local(origins)
        along = np.ascontiguousarray(directions * self.scale, dtype=np.float32)

        def query(start: int, stop: int) -> None:
            found = self._scene.run(
                local[start:stop],
                along[start:stop],
                # Not shared: the library writes where rays have ended into it.
                dists=np.full(stop - start, min(reach, _FAR), dtype=np.float32),
                query="INTERSECT",
                output=True,
            )
            hit = found["primID"]
            triangle[start:stop] = hit
            distance[start:stop] = np.where(hit >= 0, found["tfar"], np.inf)

        run_chunks(query, len(origins), CHUNK, _LEAST)
        return Hits(triangle, distance)
