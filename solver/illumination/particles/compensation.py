"""What bounded lights leave out, put back: light from surfaces that are near to a receiver ([K 5]).

A virtual light's cos cos' / r^2 is bounded by b, so that none makes a spot of its surroundings; what is left
out is light from within 1 / sqrt(b), of which corners then have too little. All of it is put back here: a ray
of length 1 / sqrt(b) is sent from the receiver, cosine-distributed, and what it meets shines by the share
1 - b / (cos cos' / r^2) of its light (Kollig and Keller 2004). That light is what is emitted there, and what
is reflected: by a solution where there is one, or found as at the receiver itself, by virtual lights and
one more ray.

In the mean the sum of both is what lights without a bound would give, for any b, but without their spots.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.glossy import GlossyLight, lobe_axis
from solver.illumination.particles.mirror_ways import Ends, has_mirrors, is_glossy
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.short_ray_kernels import BOUNCES
from solver.illumination.particles.short_rays import ShortRays
from solver.kernels import kernel
from solver.types import LUMINANCE_WEIGHTS, BoolArray, Float32Array, FloatArray, Int64Array, IntArray, Points
from solver.visibility.rays import RayScene
from solver.visibility.sampling import hash_index

Shine: TypeAlias = Callable[[Receivers, int], Float32Array]
"""Irradiance (3, n) W/m2 of receivers by bounded lights, right in the mean over the turns 0, 1, ..."""

Known: TypeAlias = Callable[[Points, IntArray], FloatArray]
"""Irradiance (n, 3) W/m2 at points (n, 3) of patches (n,), by a solution."""

_SPOT: Final = 0.1
"""Part of a lamp's radiant exitance that one light may add to what is near."""

_GOES_ON: Final = 0.5
"""Share of the ends of rays from which another is sent, from the second on: all of the first send one, or
corners become noisy."""

_UNIT: Final = 2.0**-31


@dataclass(frozen=True, eq=False)
class NearbyLight:
    """Puts back what lights bounded by `bound` leave out."""

    surfaces: Surfaces
    polygons: Polygons
    rays: RayScene
    bound: float
    """Of cos cos' / r^2 with lengths in diameters of the scene"""
    shine: Shine
    known: Known | None
    """Where given, reflected light is this solution's: of scenes that are diffuse"""
    glossy: GlossyLight | None = None
    """What lobes reflect; None where nothing is glossy"""
    emission_bounds: tuple[FloatArray, FloatArray] | None = None
    """(p,) twice: what patches emit is not bounded by less, by the lights that shine at receivers, and by
    those that shine where rays end"""

    def at(
        self, positions: Points, patch: IntArray, stream: Int64Array, turn: int, bounce: int = 0
    ) -> Float32Array:
        """Irradiance (3, n) W/m2 that is to be added at points (n, 3) on `patch` (n,), by a ray each.

        Means over `turn` = 0, 1, ... converge evenly for points of one `stream` (n,) >= 0.
        """
        return self.sample(positions, patch, stream, turn, bounce)[0]

    def sample(
        self, positions: Points, patch: IntArray, stream: Int64Array, turn: int, bounce: int = 0
    ) -> tuple[Float32Array, FloatArray]:
        """The same, with the directions (n, 3) of the rays.

        Lights are bounded by the way from their images too: rays go on at mirrors for as far as they reach.
        """
        added = np.zeros((3, len(patch)), dtype=np.float32)
        if len(patch) == 0 or not np.isfinite(self.bound) or bounce >= BOUNCES:
            return added, self.surfaces.normal[patch]
        met = self._short.send(positions, patch, stream, turn, bounce, self._least(bounce))
        ends = met.ends
        light = self.leaving(ends, stream[ends.row], turn, bounce, met.share, met.emitted)
        _add(ends.row, ends.weight, light, added)
        return added, met.directions

    def leaving(
        self,
        ends: Ends,
        stream: Int64Array,
        turn: int,
        bounce: int,
        share: FloatArray | None = None,
        emitted: FloatArray | None = None,
    ) -> FloatArray:
        """pi times the radiance (k, 3) of what rays come upon, but for the mirrors on their way.

        Where given, it is the `share` (k,) of what is reflected there, and `emitted` (k,) of what is emitted.
        """
        s, met = self.surfaces, ends.patch
        whole = np.broadcast_to(1.0, len(met))
        share = whole if share is None else share
        emitted = whole if emitted is None else emitted
        lit = self._irradiance(ends.position, met, stream, turn, bounce)
        light = np.empty((len(met), 3))
        _leave(
            met, ends.along, s.normal, s.reflectance, s.emission, s.emission_exponent, lit, share, emitted,
            light,
        )  # fmt: skip
        if self.glossy is not None:
            lobed = np.flatnonzero(is_glossy(s, met))
            axis = lobe_axis(s, met[lobed], ends.along[lobed])
            gloss = self.glossy.at(
                self, ends.position[lobed], met[lobed], axis, stream[lobed], turn, bounce + 1
            )
            light[lobed] += share[lobed, None] * s.specular[met[lobed]] * gloss.T
        return light

    @cached_property
    def _short(self) -> ShortRays:
        return ShortRays(self.surfaces, self.rays, self.bound, has_mirrors(self.surfaces))

    @cached_property
    def _is_matt(self) -> BoolArray:
        """Whether patches (p,) reflect diffusely at all."""
        return np.asarray(self.surfaces.reflectance.any(axis=1))

    def _least(self, bounce: int) -> FloatArray:
        if self.emission_bounds is None:
            return np.zeros(self.surfaces.patch_count)
        return self.emission_bounds[0 if bounce == 0 else 1]

    def _irradiance(
        self, positions: Points, patch: IntArray, stream: Int64Array, turn: int, bounce: int
    ) -> Float32Array:
        """Irradiance (3, k) W/m2 at points (k, 3); 0 where nothing is reflected."""
        matt = np.flatnonzero(self._is_matt[patch])
        if len(matt) < len(patch):
            light = np.zeros((3, len(patch)), dtype=np.float32)
            if len(matt) > 0:
                light[:, matt] = self._irradiance(positions[matt], patch[matt], stream[matt], turn, bounce)
            return light
        if self.known is not None:
            return np.ascontiguousarray(self.known(positions, patch).T, dtype=np.float32)
        lit = self.shine(Receivers.on(self.polygons, positions, patch), turn)
        if bounce == 0:
            lit += self.at(positions, patch, stream, turn, 1)
        else:
            # What is left out there in turn is little, and fewer rays tell.
            going = np.empty(len(patch), dtype=np.bool_)
            _draw_some(stream, turn, bounce, going)
            rows = np.flatnonzero(going)
            again = self.at(positions[rows], patch[rows], stream[rows], turn, bounce + 1)
            lit[:, rows] += again * np.float32(1.0 / _GOES_ON)
        return lit


def emission_bounds(surfaces: Surfaces, paths: int) -> FloatArray:
    """Bounds (p,) at which one of the lights of `paths` paths adds a small part of what its lamp emits.

    A light on a lamp stands for a known part of it, and makes no spot unless that part is close by. So lights
    on small lamps may be bounded later than others, which rays would find by chance.
    """
    exitance = surfaces.emission @ LUMINANCE_WEIGHTS
    power = float(surfaces.area @ exitance)
    if power <= 0.0:
        return np.zeros(len(exitance))
    return np.asarray(_SPOT * np.pi * paths * exitance * surfaces.size**2 / power)


@kernel
def _draw_some(stream: Int64Array, turn: int, bounce: int, chosen: BoolArray) -> None:
    """Choose `_GOES_ON` of all (n,), others in each turn."""
    for i in range(len(stream)):
        h = hash_index((np.int64(stream[i]) * BOUNCES + bounce) * 0x100003 + turn)
        chosen[i] = (h & 0x7FFFFFFF) * _UNIT < _GOES_ON


@kernel
def _leave(
    patch: IntArray,
    along: FloatArray,
    normal: FloatArray,
    reflectance: FloatArray,
    emission: FloatArray,
    exponent: FloatArray,
    lit: Float32Array,
    share: FloatArray,
    emitted: FloatArray,
    light: FloatArray,
) -> None:
    """The light (k, 3) of matt reflection of the irradiance `lit` (3, k), and of emission, along (k, 3)."""
    for i in range(len(patch)):
        p = patch[i]
        lobe = emitted[i]
        if exponent[p] != 0.0:
            there = 0.0
            for axis in range(3):
                there += along[i, axis] * normal[p, axis]
            lobe *= 0.5 * (exponent[p] + 2.0) * abs(there) ** exponent[p]
        for c in range(3):
            light[i, c] = share[i] * reflectance[p, c] * lit[c, i] + lobe * emission[p, c]


@kernel
def _add(row: Int64Array, weight: FloatArray, light: FloatArray, added: Float32Array) -> None:
    """Add weight (k, 3) times light (k, 3) to the columns `row` (k,) of added (3, n)."""
    for i in range(len(row)):
        for c in range(3):
            added[c, row[i]] += weight[i, c] * light[i, c]
