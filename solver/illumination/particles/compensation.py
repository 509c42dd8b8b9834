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
from typing import Final, TypeAlias

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.glossy import GlossyLight, lobe_axis
from solver.illumination.particles.hemisphere import tangent_frames
from solver.illumination.particles.mirror_ways import Ends, follow, is_glossy
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.kernels import kernel
from solver.types import LUMINANCE_WEIGHTS, BoolArray, Float32Array, FloatArray, Int64Array, IntArray, Points
from solver.visibility.rays import RayScene
from solver.visibility.sampling import fraction_of, hash_index

Shine: TypeAlias = Callable[[Receivers, int], Float32Array]
"""Irradiance (3, n) W/m2 of receivers by bounded lights, right in the mean over the turns 0, 1, ..."""

Known: TypeAlias = Callable[[Points, IntArray], FloatArray]
"""Irradiance (n, 3) W/m2 at points (n, 3) of patches (n,), by a solution."""

_SPOT: Final = 0.1
"""Part of a lamp's radiant exitance that one light may add to what is near."""

_GOES_ON: Final = 0.5
"""Share of the ends of rays from which another is sent, from the second on: all of the first send one, or
corners become noisy."""

_BOUNCES: Final = 16
"""After so many rays in a row light is left out; each is short, and few meet anything."""

# The plastic number's sequence (Roberts 2018), in two dimensions.
_FIRST: Final = 0.7548776662466927
_SECOND: Final = 0.5698402909980532
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
        s = self.surfaces
        if len(patch) == 0 or not np.isfinite(self.bound) or bounce >= _BOUNCES:
            return added, s.normal[patch]
        directions = _directions(s.normal[patch], stream, turn, bounce)
        reach = s.size / np.sqrt(self.bound)
        # Away from the surface, so that no ray meets it again.
        start = positions + (self.rays.offset / self.rays.scale) * s.normal[patch]
        ends = follow(s, self.rays, start, directions, reach)
        here = np.einsum("na,na->n", directions[ends.row], s.normal[patch[ends.row]])
        there = np.abs(np.einsum("na,na->n", ends.along, s.normal[ends.patch]))
        kernel_value = here * there * (s.size / np.maximum(ends.distance, 1e-30)) ** 2
        share = _left_out(kernel_value, self.bound)
        chosen = np.flatnonzero(share > 0.0)
        ends, share, kernel_value = ends.take(chosen), share[chosen], kernel_value[chosen]
        emitted = share
        if self.emission_bounds is not None:
            least = self.emission_bounds[0 if bounce == 0 else 1]
            emitted = _left_out(kernel_value, np.maximum(self.bound, least[ends.patch]))
        light = ends.weight * self.leaving(ends, stream[ends.row], turn, bounce, share, emitted)
        for depth in range(int(ends.depth.max(initial=0)) + 1):
            rows = np.flatnonzero(ends.depth == depth)
            added[:, ends.row[rows]] += light[rows].T
        return added, directions

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
        there = np.abs(np.einsum("na,na->n", ends.along, s.normal[met]))
        lobe = 0.5 * (s.emission_exponent[met] + 2.0) * there ** s.emission_exponent[met]
        light = np.zeros((len(met), 3))
        lit = np.flatnonzero(s.reflectance[met].any(axis=1)).astype(np.int32)
        light[lit] += s.reflectance[met[lit]] * self._irradiance(
            ends.position[lit], met[lit], stream[lit], turn, bounce
        )
        if self.glossy is not None:
            lobed = np.flatnonzero(is_glossy(s, met))
            axis = lobe_axis(s, met[lobed], ends.along[lobed])
            light[lobed] += (
                s.specular[met[lobed]]
                * self.glossy.at(
                    self, ends.position[lobed], met[lobed], axis, stream[lobed], turn, bounce + 1
                ).T
            )
        if share is not None:
            light *= share[:, None]
        lobe *= 1.0 if emitted is None else emitted
        return np.asarray(light + s.emission[met] * lobe[:, None])

    def _irradiance(
        self, positions: Points, patch: IntArray, stream: Int64Array, turn: int, bounce: int
    ) -> FloatArray:
        if len(patch) == 0:
            return np.empty((0, 3))
        if self.known is not None:
            return self.known(positions, patch)
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
        return np.asarray(lit.T, dtype=np.float64)


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


def _left_out(kernel_value: FloatArray, bound: FloatArray | float) -> FloatArray:
    """Share (k,) that a bound takes away from cos cos' / r^2 (k,)."""
    return np.maximum(1.0 - bound / np.maximum(kernel_value, 1e-30), 0.0)


def _directions(normal: FloatArray, stream: Int64Array, turn: int, bounce: int) -> FloatArray:
    """Cosine-distributed unit directions (n, 3) about normals (n, 3)."""
    tangent, other = tangent_frames(normal)
    local = np.empty((len(normal), 3))
    _draw(stream, turn, bounce, local)
    return np.asarray(local[:, :1] * tangent + local[:, 1:2] * other + local[:, 2:] * normal)


@kernel
def _draw_some(stream: Int64Array, turn: int, bounce: int, chosen: BoolArray) -> None:
    """Choose `_GOES_ON` of all (n,), others in each turn."""
    for i in range(len(stream)):
        h = hash_index((np.int64(stream[i]) * _BOUNCES + bounce) * 0x100003 + turn)
        chosen[i] = (h & 0x7FFFFFFF) * _UNIT < _GOES_ON


@kernel
def _draw(stream: Int64Array, turn: int, bounce: int, local: FloatArray) -> None:
    """Directions (n, 3) about z: one sequence, shifted for each stream."""
    for i in range(len(stream)):
        h = hash_index(np.int64(stream[i]) * _BOUNCES + bounce)
        u = fraction_of((h & 0x7FFFFFFF) * _UNIT + turn * _FIRST)
        v = fraction_of(((h >> 31) & 0x7FFFFFFF) * _UNIT + turn * _SECOND)
        radius = np.sqrt(u)
        local[i, 0] = radius * np.cos(2.0 * np.pi * v)
        local[i, 1] = radius * np.sin(2.0 * np.pi * v)
        local[i, 2] = np.sqrt(1.0 - u)
