"""Short rays about points, and what they come upon: drawn, traced and weighed piece by piece in kernels.

All that a ray needs stays in the caches from its direction to its end. It is no longer than what it may meet
matters: with the cosine c at its beginning, cos cos' / r^2 is above a bound b within sqrt(c / b) at most.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.mirror_ways import Ends, follow
from solver.illumination.particles.short_ray_kernels import Found, Patches, aim, arrive, by_patch, draw
from solver.parallel import run_chunks
from solver.types import FloatArray, Int64Array, IntArray, Points
from solver.visibility.rays import RayScene

_CHUNK: Final = 8192
_LEAST: Final = 512


@dataclass(frozen=True, eq=False)
class Met:
    """What short rays come upon, as far as it matters."""

    directions: FloatArray
    """(n, 3) unit, of all rays"""
    ends: Ends
    """The k of them that come upon anything, patch by patch where there are no mirrors"""
    share: FloatArray
    """(k,) part of what is reflected there that a bound takes away"""
    emitted: FloatArray
    """(k,) part of what is emitted there"""


@dataclass(frozen=True, eq=False)
class ShortRays:
    """Rays to all from which light may be bounded."""

    surfaces: Surfaces
    rays: RayScene
    bound: float
    """Of cos cos' / r^2 with lengths in diameters of the scene; finite"""
    has_mirrors: bool
    """Whether there are perfect mirrors, at which rays go on"""

    def send(
        self,
        positions: Points,
        patch: IntArray,
        stream: Int64Array,
        turn: int,
        bounce: int,
        emission_bound: FloatArray,
    ) -> Met:
        """Send a cosine-distributed ray from each of the points (n, 3) on `patch` (n,).

        Means over `turn` = 0, 1, ... converge evenly for points of one `stream` (n,) >= 0. What patches emit
        is not bounded by less than `emission_bound` (p,).
        """
        if self.has_mirrors:
            return self._send_by_mirrors(positions, patch, stream, turn, bounce, emission_bound)
        s, rays, n = self.surfaces, self.rays, len(patch)
        directions = np.empty((n, 3))
        found = Found.room(n)
        patches = self._patches(emission_bound)
        counts: dict[int, int] = {}

        def trace(start: int, stop: int) -> None:
            origins = np.empty((stop - start, 3), dtype=np.float32)
            along = np.empty((stop - start, 3), dtype=np.float32)
            draw(start, stop, patch, s.normal, stream, turn, bounce, directions)
            aim(
                start, stop, positions, patch, s.normal, s.center, rays.scale, rays.offset, directions,
                self.bound, origins, along,
            )  # fmt: skip
            triangle = rays.first_local(origins, along, 1.0)
            counts[start] = arrive(
                start, stop, triangle, positions, patch, directions, patches, s.size, rays.offset,
                self.bound, found,
            )  # fmt: skip

        run_chunks(trace, n, _CHUNK, _LEAST)
        begin = np.array(sorted(counts), dtype=np.int64)
        end = np.array([start + counts[start] for start in begin.tolist()], dtype=np.int64)
        # Ends on one patch are lit together, which takes a third of the time.
        order = by_patch(begin, end, found.patch, s.patch_count)
        one, k = Found(*(of[order] for of in found)), len(order)
        weight, depth = np.broadcast_to(1.0, (k, 3)), np.broadcast_to(np.int32(0), k)
        ends = Ends(one.row, one.position, one.patch, one.along, one.distance, weight, depth)
        return Met(directions, ends, one.share, one.emitted)

    def _patches(self, emission_bound: FloatArray) -> Patches:
        s = self.surfaces
        reflects = np.asarray(s.reflectance.any(axis=1) | s.specular.any(axis=1))
        emits = np.asarray(s.emission.any(axis=1))
        return Patches(s.triangle_patch, s.corners, s.normal, reflects, emits, emission_bound)

    def _send_by_mirrors(
        self,
        positions: Points,
        patch: IntArray,
        stream: Int64Array,
        turn: int,
        bounce: int,
        emission_bound: FloatArray,
    ) -> Met:
        """The same in a scene of mirrors: bounds are of the whole way, and rays go on as far."""
        s, n = self.surfaces, len(patch)
        directions = np.empty((n, 3))
        draw(0, n, patch, s.normal, stream, turn, bounce, directions)
        # Away from the surface, so that no ray meets it again.
        start = positions + (self.rays.offset / self.rays.scale) * s.normal[patch]
        ends = follow(s, self.rays, start, directions, s.size / np.sqrt(self.bound))
        here = np.einsum("na,na->n", directions[ends.row], s.normal[patch[ends.row]])
        there = np.abs(np.einsum("na,na->n", ends.along, s.normal[ends.patch]))
        kernel_value = here * there * (s.size / np.maximum(ends.distance, 1e-30)) ** 2
        share = _left_out(kernel_value, self.bound)
        emitted = _left_out(kernel_value, np.maximum(self.bound, emission_bound[ends.patch]))
        chosen = np.flatnonzero(share > 0.0)
        return Met(directions, ends.take(chosen), share[chosen], emitted[chosen])


def _left_out(kernel_value: FloatArray, bound: FloatArray | float) -> FloatArray:
    """Share (k,) that a bound takes away from cos cos' / r^2 (k,)."""
    return np.maximum(1.0 - bound / np.maximum(kernel_value, 1e-30), 0.0)
