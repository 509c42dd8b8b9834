"""Irradiance by virtual lights, shadowed: what the images of [K 3] add up to, at any points.

Each light adds P / pi cos cos' / r^2 to what sees it, with the product of cosines over r^2 bounded: near a
light it grows without limit ([K 5]), and what the bound takes away is put back by `compensation`.

A graphics card would do this as a pass over the screen. On a processor, where shaders run on the same cores
as kernels but pay for both sides of every branch, a kernel does it some 15 times as fast; and it lights
whatever points there are, texels of lightmaps and ends of rays too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver.illumination.particles.folds import Folds, first_of, is_hidden_on_the_way, passes_by, trim
from solver.illumination.particles.hemisphere import tangent_frames
from solver.illumination.particles.hiding import is_hidden
from solver.illumination.particles.light_lobes import Gloss, polish, shape
from solver.illumination.particles.lights import VirtualLights
from solver.illumination.particles.receivers import Polygons, Receivers, local
from solver.illumination.particles.sights import Sights, Texels
from solver.kernels import inline_kernel, kernel
from solver.parallel import run_chunks
from solver.tolerances import TOUCH
from solver.types import Float32Array, FloatArray, Int64Array, IntArray, Points

BLOCK: Final = 256
"""Receivers lit together: their terms stay in the first-level cache."""

_CHUNK: Final = 8 * BLOCK

_LEAST_GLOSS: Final = 2.0**-20
"""Exponents of lobes below this are taken for it: it tells them from no lobe."""


@dataclass(frozen=True, eq=False)
class ShiningLights:
    """m lights as the kernel takes them."""

    frames: Float32Array
    """(15, m) local position, unit normal, two tangents, and the axis of the lobe: the normal, but for
    glossy lights, which have the mirrored direction there"""
    power: Float32Array
    """(m, 3) local: W over pi and the squared size of the scene, W/m2"""
    lobe: Float32Array
    """(m,) k: intensity goes by the cosine to the normal, and by cos^(k - 1) to the axis; 1 is Lambert's"""
    least_bound: Float32Array
    """(m,) local: a lower bound is not heeded"""

    @classmethod
    def of(
        cls,
        polygons: Polygons,
        position: Points,
        normal: FloatArray,
        power: FloatArray,
        lobe: FloatArray,
        axis: FloatArray | None = None,
    ) -> ShiningLights:
        """Lights at world `position` (m, 3) of `power` (m, 3) W, with lobes about `axis`, or the normal."""
        tangent, other = tangent_frames(normal)
        axis = normal if axis is None else axis
        frames = np.concatenate([local(polygons.surfaces, position), normal, tangent, other, axis], axis=1).T
        scale = 0.5 * (lobe + 1.0) / (np.pi * polygons.surfaces.size**2)
        return cls(
            np.ascontiguousarray(frames, dtype=np.float32),
            (power * scale[:, None]).astype(np.float32),
            lobe.astype(np.float32),
            np.zeros(len(lobe), dtype=np.float32),
        )

    @classmethod
    def all_of(
        cls, polygons: Polygons, lights: VirtualLights, emission_bound: FloatArray | None = None
    ) -> ShiningLights:
        """`lights`, glossy ones by their gloss; images by where they are, not by what they shine through.

        What patches emit is not bounded by less than their `emission_bound` (p,), where given.
        """
        along = np.einsum("ma,ma->m", lights.incident, lights.normal)
        mirrored = lights.incident - 2.0 * along[:, None] * lights.normal
        glossy = lights.gloss >= 0.0
        # A lobe of n = 0 ends at a right angle to its axis, which Lambert's does not.
        lobe = np.where(glossy, 1.0 + np.maximum(lights.gloss, _LEAST_GLOSS), lights.lobe)
        axis = np.where(glossy[:, None], mirrored, lights.normal)
        made = cls.of(polygons, lights.position, lights.normal, lights.power, lobe, axis)
        if emission_bound is None:
            return made
        least = np.where(lights.generation == 0, emission_bound[lights.patch], 0.0)
        return replace(made, least_bound=least.astype(np.float32))

    def __len__(self) -> int:
        return len(self.lobe)

    def take(self, rows: Int64Array) -> ShiningLights:
        """Those with the indices `rows`."""
        return ShiningLights(
            np.ascontiguousarray(self.frames[:, rows]),
            self.power[rows],
            self.lobe[rows],
            self.least_bound[rows],
        )

    def part(self, first: int, last: int) -> ShiningLights:
        """The lights [first, last)."""
        return ShiningLights(
            np.ascontiguousarray(self.frames[:, first:last]),
            self.power[first:last],
            self.lobe[first:last],
            self.least_bound[first:last],
        )

    def scaled(self, factor: float | Float32Array) -> ShiningLights:
        """All of them, `factor` times as strong, or each by its own (m,); without power they cost nothing."""
        each = np.broadcast_to(np.float32(factor), len(self))
        return replace(self, power=each[:, None] * self.power)


def add_light(
    irradiance: Float32Array,
    receivers: Receivers,
    lights: ShiningLights,
    sights: Sights,
    bound: float,
    folds: Folds | None = None,
    gloss: Gloss | None = None,
) -> None:
    """Add to `irradiance` (3, n) W/m2 what `lights` give to `receivers` that their `sights` do not hide.

    `bound` is local: of cos cos' / r^2 with lengths in diameters of the scene; infinite for none. With
    `folds` only the images among the lights shine. With `gloss` light counts by (n + 2) / 2 cos^n of the
    angle to the lobe's axis: over pi, and times rho_s, it is the radiance that lobes reflect to their eyes.
    """
    # What an image sees does not tell all of its light's way.
    alike = sights.alike if folds is None else sights.texels
    run_chunks(
        lambda start, stop: _light(
            start, stop, receivers.frame, receivers.polygon, lights.frames, lights.power, lights.lobe,
            lights.least_bound, sights.texels, alike, sights.start, sights.polygon, sights.cone,
            np.float32(bound), irradiance, folds, gloss,
        ),
        len(receivers),
        _CHUNK,
    )  # fmt: skip


@kernel
def _light(
    start: int,
    stop: int,
    receivers: Float32Array,
    polygon: IntArray,
    lights: Float32Array,
    power: Float32Array,
    lobe: Float32Array,
    least_bound: Float32Array,
    texels: Texels,
    alike: Texels,
    sight_start: IntArray,
    seen: IntArray,
    cone: Float32Array,
    bound: np.float32,
    irradiance: Float32Array,
    folds: Folds | None,
    gloss: Gloss | None,
) -> None:
    # What a scene has not is None, which is a type to the compiler: its branches are not made.
    gain = np.empty(BLOCK, dtype=np.float32)
    texel = np.empty(BLOCK, dtype=np.int32)
    unclear = np.empty(BLOCK, dtype=np.int32)
    low = np.empty(3, dtype=np.float32)
    high = np.empty(3, dtype=np.float32)
    zero = np.float32(0.0)
    size = texels.shape[1]
    for first in range(start, stop, BLOCK):
        last = min(stop, first + BLOCK)
        n = last - first
        x, y, z = receivers[0, first:last], receivers[1, first:last], receivers[2, first:last]
        nx, ny, nz = receivers[3, first:last], receivers[4, first:last], receivers[5, first:last]
        own = polygon[first:last]
        red, green, blue = irradiance[0, first:last], irradiance[1, first:last], irradiance[2, first:last]
        is_flat = _bounds(receivers, first, last, low, high)
        for k in range(first_of(folds), lights.shape[1]):
            # Whole blocks behind the light, or with the light behind them, and lights without power.
            if power[k, 0] == zero and power[k, 1] == zero and power[k, 2] == zero:
                continue
            reach = zero
            for axis in range(3):
                a = lights[3 + axis, k]
                reach += a * ((high[axis] if a > zero else low[axis]) - lights[axis, k])
            if reach <= zero:
                continue
            if is_flat and (
                nx[0] * (lights[0, k] - x[0]) + ny[0] * (lights[1, k] - y[0]) + nz[0] * (lights[2, k] - z[0])
                <= zero
            ):
                continue
            if passes_by(low, high, lights, k, folds):
                continue
            _receive(x, y, z, nx, ny, nz, lights, k, max(bound, least_bound[k]), size, gain, texel)
            if lobe[k] != np.float32(1.0):
                shape(x, y, z, lights, k, lobe[k], gain)
            if folds is not None:
                trim(x, y, z, lights, k, folds, gain)
            if gloss is not None:
                polish(x, y, z, lights, k, gloss, first, gain)
            # Who does not see the light for certain, and then whether they do.
            sight, same = texels[k].reshape(size * size), alike[k].reshape(size * size)
            base = sight_start[k]
            count = 0
            for i in range(n):
                unclear[count] = i
                count += gain[i] > zero and (folds is not None or seen[base + same[texel[i]]] != own[i])
            for j in range(count):
                i = unclear[j]
                at = texel[i]
                if folds is None:
                    hidden = is_hidden(
                        x[i], y[i], z[i], x[i] - lights[0, k], y[i] - lights[1, k], z[i] - lights[2, k],
                        own[i], base, sight[at], sight[at + 1], sight[at + size], sight[at + size + 1],
                        seen, cone, None,
                    )  # fmt: skip
                else:
                    hidden = is_hidden_on_the_way(
                        x[i], y[i], z[i], own[i], lights, k, at, texels, sight_start, seen, cone, folds
                    )
                if hidden:
                    gain[i] = zero
            r, g, b = power[k, 0], power[k, 1], power[k, 2]
            for i in range(n):
                red[i] += gain[i] * r
                green[i] += gain[i] * g
                blue[i] += gain[i] * b


@kernel
def _bounds(receivers: Float32Array, first: int, last: int, low: Float32Array, high: Float32Array) -> bool:
    """Bounding box of some receivers; whether they lie on one plane."""
    is_flat = True
    for axis in range(3):
        low[axis] = high[axis] = receivers[axis, first]
        for i in range(first + 1, last):
            low[axis] = min(low[axis], receivers[axis, i])
            high[axis] = max(high[axis], receivers[axis, i])
            is_flat = is_flat and receivers[3 + axis, i] == receivers[3 + axis, first]
    if not is_flat:
        return False
    x, y, z = receivers[3, first], receivers[4, first], receivers[5, first]
    level = x * receivers[0, first] + y * receivers[1, first] + z * receivers[2, first]
    for i in range(first + 1, last):
        if abs(x * receivers[0, i] + y * receivers[1, i] + z * receivers[2, i] - level) > np.float32(TOUCH):
            return False
    return True


@inline_kernel
def _receive(
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    nx: Float32Array,
    ny: Float32Array,
    nz: Float32Array,
    lights: Float32Array,
    k: int,
    bound: np.float32,
    size: int,
    gain: Float32Array,
    texel: IntArray,
) -> None:
    """Bounded cos cos' / r^2 of a light at receivers (n,), and the first of the four texels around each."""
    zero = np.float32(0.0)
    half = np.float32(0.5) * np.float32(size)
    shift = half - np.float32(0.5)
    most = np.float32(size) - np.float32(1.01)
    vx, vy, vz = lights[0, k], lights[1, k], lights[2, k]
    ax, ay, az = lights[3, k], lights[4, k], lights[5, k]
    tx, ty, tz = lights[6, k], lights[7, k], lights[8, k]
    bx, by, bz = lights[9, k], lights[10, k], lights[11, k]
    for i in range(len(x)):
        dx, dy, dz = x[i] - vx, y[i] - vy, z[i] - vz
        square = dx * dx + dy * dy + dz * dz
        here = max(-(nx[i] * dx + ny[i] * dy + nz[i] * dz), zero)
        there = max(ax * dx + ay * dy + az * dz, zero)
        gain[i] = min(here * there / (square * square), bound) if square > zero else zero
        s, t = tx * dx + ty * dy + tz * dz, bx * dx + by * dy + bz * dz
        scale = half / max(abs(s) + abs(t) + there, np.float32(1e-30))
        column = min(max((s + t) * scale + shift, zero), most)
        row = min(max((s - t) * scale + shift, zero), most)
        texel[i] = np.int32(row) * np.int32(size) + np.int32(column)
