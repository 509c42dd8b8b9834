"""The rays between two elements: from quadrant to quadrant, each with its weight and its place on either end.

A pair is sampled by 16 s rays: each quadrant of one element towards each quadrant of the other, s times,
at points of a low-discrepancy sequence shifted by a hash of the pair's keys.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.types import ByteArray, Corners, Float32Array, FloatArray, Int64Array, IntArray, Points
from solver.visibility.sampling import fraction_of, hash_index, sample_by_solid_angle, sample_element

STRATA: Final = 16
"""Quadrant pairs of a link."""

NEAR: Final = 2.0
"""Elements nearer than this many times their size are sampled by solid angle."""

# The R4 sequence: powers of the reciprocal of the root of x^5 = x + 1.
_ROOT = 1.1673039782614187
_STEP: Final[FloatArray] = np.array([_ROOT**-1, _ROOT**-2, _ROOT**-3, _ROOT**-4])


@kernel
def _is_close(corners: FloatArray, count: int, other: FloatArray, other_count: int) -> bool:
    """Whether two elements (4, 3) are closer than their size: the kernel varies much between them."""
    x = y = z = 0.0
    for k in range(count):
        x += corners[k, 0] / count
        y += corners[k, 1] / count
        z += corners[k, 2] / count
    for k in range(other_count):
        x -= other[k, 0] / other_count
        y -= other[k, 1] / other_count
        z -= other[k, 2] / other_count
    size = 0.0
    for k in range(2):
        for axis in range(3):
            size += (corners[k, axis] - corners[k + 2, axis]) ** 2
            size += (other[k, axis] - other[k + 2, axis]) ** 2
    return x * x + y * y + z * z < NEAR * NEAR * size


@kernel
def _quadrant(corners: FloatArray, count: int, y: FloatArray) -> int:
    """Which quadrant of an element (4, 3) a point of it is in: by the halves of two adjacent sides."""
    along = 0.0
    across = 0.0
    last = count - 1
    for axis in range(3):
        du = corners[1, axis] - corners[0, axis]
        dv = corners[last, axis] - corners[0, axis]
        if count == 4:
            du += corners[2, axis] - corners[3, axis]
            dv += corners[2, axis] - corners[1, axis]
        middle = 0.0
        for k in range(count):
            middle += corners[k, axis] / count
        along += (y[axis] - middle) * du
        across += (y[axis] - middle) * dv
    return (1 if along > 0.0 else 0) + (2 if across > 0.0 else 0)


@kernel
def generate_rays(
    p: IntArray,
    q: IntArray,
    samples: int,
    corners: Corners,
    counts: IntArray,
    area: FloatArray,
    patch: IntArray,
    normals: FloatArray,
    axes: FloatArray,
    lift: FloatArray,
    centroid: Points,
    key: Int64Array,
    center: FloatArray,
    scale: float,
    first: int,
    start: int,
    stop: int,
    origins: Float32Array,
    directions: Float32Array,
    weights: FloatArray,
    strata: ByteArray,
    places: Float32Array,
) -> None:
    """Rays of links [start, stop); row 0 of the outputs belongs to link `first`."""
    x = np.empty(3)
    y = np.empty(3)
    work = np.empty((8, 3))
    shift = np.empty(4)
    for link in range(start, stop):
        # From the smaller end to the larger.
        swapped = area[p[link]] > area[q[link]]
        i = q[link] if swapped else p[link]
        j = p[link] if swapped else q[link]
        n1 = normals[patch[i]]
        n2 = normals[patch[j]]
        close = _is_close(corners[i], counts[i], corners[j], counts[j])
        h = hash_index(key[i] * np.int64(1000003) + key[j])
        for axis in range(4):
            shift[axis] = ((h >> (15 * axis)) & 0x7FFF) / 32768.0
        ray = (link - first) * STRATA * samples
        for s in range(STRATA * samples):
            stratum = s % STRATA
            index = stratum * samples + s // STRATA + 1
            u1 = 0.5 * ((stratum & 1) + fraction_of(shift[0] + index * _STEP[0]))
            v1 = 0.5 * (((stratum >> 1) & 1) + fraction_of(shift[1] + index * _STEP[1]))
            u2 = 0.5 * (((stratum >> 2) & 1) + fraction_of(shift[2] + index * _STEP[2]))
            v2 = 0.5 * (((stratum >> 3) & 1) + fraction_of(shift[3] + index * _STEP[3]))
            weight = sample_element(corners[i], counts[i], n1, area[i], u1, v1, x)
            if close:
                weight *= sample_by_solid_angle(corners[j], counts[j], n2, x, u2, v2, work, y)
            else:
                weight *= sample_element(corners[j], counts[j], n2, area[j], u2, v2, y)
            near = stratum & 3
            far = _quadrant(corners[j], counts[j], y) if close and weight > 0.0 else stratum >> 2
            square = 0.0
            cosine1 = 0.0
            cosine2 = 0.0
            for axis in range(3):
                d = y[axis] - x[axis]
                square += d * d
                cosine1 += d * n1[axis]
                cosine2 -= d * n2[axis]
            if weight > 0.0 and square > 0.0 and cosine1 > 0.0 and cosine2 > 0.0:
                weights[ray] = weight * (
                    cosine1 / math.sqrt(square) if close else cosine1 * cosine2 / (square * square)
                )
                strata[ray] = near * 4 + far if swapped else far * 4 + near
                _place(x, centroid[i], axes[patch[i]], places[ray, 2:] if swapped else places[ray, :2])
                _place(y, centroid[j], axes[patch[j]], places[ray, :2] if swapped else places[ray, 2:])
                for axis in range(3):
                    a = np.float32((x[axis] - center[axis]) * scale + lift[patch[i]] * n1[axis])
                    b = np.float32((y[axis] - center[axis]) * scale + lift[patch[j]] * n2[axis])
                    origins[ray, axis] = a
                    directions[ray, axis] = b - a
            else:
                weights[ray] = 0.0
                strata[ray] = 0
                places[ray, :] = 0.0
                for axis in range(3):
                    origins[ray, axis] = 0.0
                    directions[ray, axis] = 0.0
            ray += 1


@kernel
def _place(x: FloatArray, centroid: FloatArray, axes: FloatArray, out: Float32Array) -> None:
    """Coordinates of x (3,) from the centroid, by axes (2, 3)."""
    for k in range(2):
        total = 0.0
        for axis in range(3):
            total += (x[axis] - centroid[axis]) * axes[k, axis]
        out[k] = total
