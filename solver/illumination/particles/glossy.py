"""Light that lobes reflect towards an eye ([K 4.2]).

A broad lobe is lit by virtual lights, each by the lobe's value towards it. A narrow one sees few of them, and
each as a spot: there a ray is sent by the lobe's own distribution, and what it meets shines as it does at a
pixel, by virtual lights on its matt part and by another ray for its lobe. Neither errs in the mean, and both
give what f_r = rho_s (n + 2) / (2 pi) cos^n(alpha) makes of all light that arrives, as an irradiance: light
counts by (n + 2) / 2 cos^n(alpha), so that rho_s over pi makes radiance of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol, TypeAlias

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.emission import lobe_direction
from solver.illumination.particles.light_lobes import Gloss
from solver.illumination.particles.mirror_ways import Ends, follow, mirrored
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.kernels import kernel
from solver.types import BoolArray, Float32Array, FloatArray, Int64Array, IntArray, Points
from solver.visibility.rays import RayScene
from solver.visibility.sampling import fraction_of, hash_index

BROADEST: Final = 16.0
"""Lobes that pixels show are narrow above this exponent: there both ways err alike on a glossy floor."""

BROADEST_BEYOND: Final = 300.0
"""The same of lobes that rays come upon, each seen once: a ray that finds a lamp makes a spot."""

_BOUNCES: Final = 16
"""After so many rays in a row light is left out; from the second on they end at random."""

# Multiples of the roots of 2 and 3: even by themselves, and beside the sequence of rays to what is near, with
# which they have no relation.
_FIRST: Final = 0.4142135623730950
_SECOND: Final = 0.7320508075688773
_UNIT: Final = 2.0**-31
_OWN: Final = 1 << 48
"""Streams of lobes are numbered from here on."""

Polish: TypeAlias = Callable[[Receivers, Gloss, int], Float32Array]
"""Irradiance (3, n) W/m2 by bounded lights, counted by lobes, right in the mean over the turns 0, 1, ..."""


class Surroundings(Protocol):
    """What lobes ask of the light around them; see `compensation.NearbyLight`."""

    def leaving(self, ends: Ends, stream: Int64Array, turn: int, bounce: int) -> FloatArray:
        """pi times the radiance (k, 3) of what rays come upon, but for the mirrors on their way."""

    def sample(
        self, positions: Points, patch: IntArray, stream: Int64Array, turn: int, bounce: int
    ) -> tuple[Float32Array, FloatArray]:
        """Irradiance (3, n) that bounded lights leave out, each by one direction (n, 3), and these."""


@dataclass(frozen=True, eq=False)
class GlossyLight:
    """What lobes reflect, wherever they are."""

    surfaces: Surfaces
    polygons: Polygons
    rays: RayScene
    polish: Polish

    def at(
        self,
        around: Surroundings,
        positions: Points,
        patch: IntArray,
        axis: FloatArray,
        stream: Int64Array,
        turn: int,
        bounce: int,
    ) -> FloatArray:
        """Irradiance (3, n) W/m2 at points (n, 3) of glossy `patch` (n,), by lobes about `axis` (n, 3)."""
        light = np.zeros((3, len(patch)))
        if len(patch) == 0 or bounce >= _BOUNCES:
            return light
        broad = self.surfaces.exponent[patch] <= BROADEST_BEYOND
        rows = np.flatnonzero(broad)
        if len(rows) > 0:
            gloss = gloss_of(self.surfaces, patch[rows], axis[rows])
            receivers = Receivers.on(self.polygons, positions[rows], patch[rows])
            light[:, rows] = self.polish(receivers, gloss, turn)
            found, along = around.sample(positions[rows], patch[rows], stream[rows], turn, bounce + 1)
            light[:, rows] += found * lobe_factor(gloss, along)
        rows = np.flatnonzero(~broad)
        light[:, rows] = self.by_rays(
            around, positions[rows], patch[rows], axis[rows], stream[rows], turn, bounce
        )
        return light

    def by_rays(
        self,
        around: Surroundings,
        positions: Points,
        patch: IntArray,
        axis: FloatArray,
        stream: Int64Array,
        turn: int,
        bounce: int = 0,
    ) -> FloatArray:
        """The same by a ray from each point, however broad its lobe."""
        light = np.zeros((3, len(patch)))
        s = self.surfaces
        exponent = s.exponent[patch]
        survival = np.ones(len(patch)) if bounce == 0 else s.specular[patch].max(axis=1)
        directions = np.empty((len(patch), 3))
        draws = np.empty(len(patch))
        _draw(stream, turn, bounce, axis, exponent, directions, draws)
        normal = s.normal[patch]
        cosine = np.einsum("na,na->n", directions, normal)
        rows = np.flatnonzero((cosine > 0.0) & (draws < survival))
        if len(rows) == 0:
            return light
        weight = (exponent[rows] + 2.0) / (exponent[rows] + 1.0) * cosine[rows] / survival[rows]
        start = positions[rows] + (self.rays.offset / self.rays.scale) * normal[rows]
        ends = follow(s, self.rays, start, directions[rows])
        row = rows[ends.row]
        shining = ends.weight * around.leaving(ends, stream[row], turn, bounce)
        np.add.at(light.T, row, weight[ends.row, None] * shining)
        return light


def is_broad(surfaces: Surfaces, patch: IntArray) -> BoolArray:
    """Whether the lobes of glossy patches (n,), shown by pixels, are lit by virtual lights."""
    return np.asarray(surfaces.exponent[patch] <= BROADEST)


def gloss_of(surfaces: Surfaces, patch: IntArray, axis: FloatArray) -> Gloss:
    """The lobes of patches (n,) about `axis` (n, 3)."""
    return Gloss(np.ascontiguousarray(axis.T, dtype=np.float32), surfaces.exponent[patch].astype(np.float32))


def lobe_axis(surfaces: Surfaces, patch: IntArray, along: FloatArray) -> FloatArray:
    """Unit axes (n, 3) of lobes on `patch` (n,) for eyes that look at them along `along` (n, 3), unit."""
    return mirrored(along, surfaces.normal[patch])


def lobe_factor(gloss: Gloss, directions: FloatArray) -> FloatArray:
    """How light from unit `directions` (n, 3) counts."""
    cosine = np.clip(np.einsum("an,na->n", gloss.axis, directions), 0.0, 1.0)
    return np.asarray(np.where(cosine > 0.0, 0.5 * (gloss.exponent + 2.0) * cosine**gloss.exponent, 0.0))


@kernel
def _draw(
    stream: Int64Array,
    turn: int,
    bounce: int,
    axis: FloatArray,
    exponent: FloatArray,
    directions: FloatArray,
    draws: FloatArray,
) -> None:
    """Directions (n, 3) by their lobes, and numbers (n,) for whether they end.

    First rays of a stream follow one sequence, shifted; later ones, which do so beside them, are random.
    """
    for i in range(len(stream)):
        seed = _OWN + np.int64(stream[i]) * _BOUNCES + bounce
        if bounce > 0:
            seed = hash_index(np.int64(seed)) ^ np.int64(turn)
        h = hash_index(np.int64(seed))
        shift = float(turn) if bounce == 0 else 0.0
        u = fraction_of((h & 0x7FFFFFFF) * _UNIT + shift * _FIRST)
        v = fraction_of(((h >> 31) & 0x7FFFFFFF) * _UNIT + shift * _SECOND)
        directions[i, 0], directions[i, 1], directions[i, 2] = lobe_direction(
            axis[i, 0], axis[i, 1], axis[i, 2], exponent[i], u, v
        )
        draws[i] = (hash_index(h) & 0x7FFFFFFF) * _UNIT
