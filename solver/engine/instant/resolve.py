"""From points back to pixels: kernels of what a picture is made of.

Points that pixels show themselves have a pixel each, so that pieces of them may be added at the same time;
those by mirrors may not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import BoolArray, Float32Array, FloatArray, Int64Array, IntArray, Points, Vector

CHUNK: Final = 1 << 14
"""Points of a piece of work"""


class Glow(NamedTuple):
    """What patches (p,) make of irradiance, and what they emit."""

    normal: FloatArray
    """(p, 3)"""
    emitted: FloatArray
    """(p, 3) W/(m2 sr), of a diffuse emitter"""
    exponent: FloatArray
    """(p,) of emission"""
    reflected: FloatArray
    """(p, 3) radiance for each W/m2"""

    @classmethod
    def of(cls, surfaces: Surfaces) -> Glow:
        """That of `surfaces`."""
        return cls(
            surfaces.normal,
            surfaces.emission / np.pi,
            surfaces.emission_exponent,
            surfaces.reflectance / np.pi,
        )


def in_pieces(add: Callable[[int, int], object], shown: int, count: int) -> None:
    """Call `add(start, stop)` over all points, of which the first `shown` are those that pixels show."""
    run_chunks(add, shown, CHUNK)
    if count > shown:
        add(shown, count)


@kernel
def add_to_pixels(pixel: IntArray, values: FloatArray, picture: FloatArray) -> None:
    """Add values (n, c) of points to their pixels (n,) of picture (k, c)."""
    for i in range(len(pixel)):
        for c in range(picture.shape[1]):
            picture[pixel[i], c] += values[i, c]


@kernel
def add_irradiance(
    start: int, stop: int, pixel: IntArray, light: Float32Array, share: float, picture: FloatArray
) -> None:
    """Add `share` of light (3, n) of the points [start, stop) to their pixels (n,) of picture (k, 3)."""
    for i in range(start, stop):
        for c in range(3):
            picture[pixel[i], c] += share * light[c, i]


@kernel
def add_radiance(
    start: int,
    stop: int,
    pixel: IntArray,
    patch: IntArray,
    position: Points,
    eye: Vector,
    shown: int,
    arrival: FloatArray,
    left: FloatArray,
    glow: Glow,
    light: Float32Array,
    share: float,
    picture: FloatArray,
) -> None:
    """Add `share` of what points emit, and reflect of light (3, n), to their pixels (n,).

    Those from `shown` on are seen by mirrors, along `arrival` (n - shown, 3), by `left` (n - shown, 3).
    """
    for i in range(start, stop):
        p = patch[i]
        lobe = 1.0
        exponent = glow.exponent[p]
        if exponent != 0.0:
            cosine = square = 0.0
            for axis in range(3):
                along = position[i, axis] - eye[axis] if i < shown else arrival[i - shown, axis]
                cosine -= along * glow.normal[p, axis]
                square += along * along
            cosine /= np.sqrt(square)
            lobe = 0.5 * (exponent + 2.0) * max(cosine, 0.0) ** exponent
        for c in range(3):
            radiance = lobe * glow.emitted[p, c] + glow.reflected[p, c] * light[c, i]
            picture[pixel[i], c] += share * (1.0 if i < shown else left[i - shown, c]) * radiance


@kernel
def add_luminance(
    start: int,
    stop: int,
    pixel: IntArray,
    patch: IntArray,
    shown: int,
    left: FloatArray,
    matt: FloatArray,
    light: Float32Array,
    seen: FloatArray,
) -> None:
    """Add to pixels `seen` (k,) the luminance that points reflect by matt (p, 3) of light (3, n)."""
    for i in range(start, stop):
        value = 0.0
        for c in range(3):
            value += (1.0 if i < shown else left[i - shown, c]) * matt[patch[i], c] * light[c, i]
        seen[pixel[i]] += value


@kernel
def add_weighed(
    start: int,
    stop: int,
    light: Float32Array,
    valid: BoolArray,
    paths: np.float32,
    total: Float32Array,
    weight: Float32Array,
) -> None:
    """Add light (3, n) `paths` times to `total` where it is valid (n,), and `paths` to weight (n,)."""
    for c in range(3):
        for i in range(start, stop):
            total[c, i] += (paths if valid[i] else np.float32(0.0)) * light[c, i]
    for i in range(start, stop):
        weight[i] += paths if valid[i] else np.float32(0.0)


@kernel
def divide(start: int, stop: int, total: Float32Array, weight: Float32Array) -> None:
    """Make means of sums (3, n) of weights (n,), which are whole numbers; 0 where there is none."""
    for c in range(3):
        for i in range(start, stop):
            total[c, i] /= max(weight[i], np.float32(1.0))


@kernel
def take_in(mean: FloatArray, before: int, fresh: FloatArray, paths: int) -> tuple[float, float]:
    """Take an image (k,) of so many paths into the mean (k,) of those `before`.

    Returns the mean square of their difference, and that of the new mean.
    """
    apart = power = 0.0
    share = paths / (before + paths)
    for i in range(len(mean)):
        difference = fresh[i] - mean[i]
        mean[i] += share * difference
        apart += difference * difference
        power += mean[i] * mean[i]
    return apart / len(mean), power / len(mean)


@kernel
def add_shared(run: Int64Array, found: Float32Array, share: np.float32, light: Float32Array) -> None:
    """Add `share` of found (3, k) to the columns run[k] to run[k + 1] of light (3, n)."""
    for c in range(3):
        for k in range(found.shape[1]):
            value = share * found[c, k]
            for i in range(run[k], run[k + 1]):
                light[c, i] += value
