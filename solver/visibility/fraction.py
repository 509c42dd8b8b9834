"""How much two elements see of each other: rays between strata of both, through Embree.

A pair is sampled by 16 s rays: each quadrant of one element towards each quadrant of the other, s times,
at points of a low-discrepancy sequence shifted by a hash of the pair. The strata tell not only the
visible fraction, weighted by the transport kernel, but also how it differs from quadrant to quadrant of
either end: how much there is to gain from subdividing it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import BoolArray, Corners, Float32Array, FloatArray, IntArray, ByteArray, Points
from solver.visibility.rays import RayScene
from solver.visibility.sampling import hash_index, sample_by_solid_angle, sample_element

STRATA: Final = 16
"""Quadrant pairs of a link."""

STRATIFIED: Final = 0.5
"""Variance of a stratified sample relative to that of a random one."""

NEAR: Final = 2.0
"""Elements nearer than this many times their size are sampled by solid angle."""

MISSED: Final = 0.2
"""Part of a sample that may be of the other kind than all that were taken."""

STEP: Final = 0.25
"""Share of the variance of a step that no linear function explains."""

BATCH: Final = 1 << 17
"""Rays generated and traced at a time, which bounds memory."""

_CHUNK: Final = 512
# The R4 sequence: powers of the reciprocal of the root of x^5 = x + 1.
_ROOT = 1.1673039782614187
_STEP: Final[FloatArray] = np.array([_ROOT**-1, _ROOT**-2, _ROOT**-3, _ROOT**-4])


@dataclass(frozen=True, eq=False)
class VisibleFractions:
    """What n pairs see of each other."""

    visibility: FloatArray
    """(n,) visible fraction of the exchange area"""
    noise: FloatArray
    """(n,) its expected squared error"""
    lean_p: FloatArray
    """(n, 2) covariance of visibility and position on p, m, by the axes of its patch; less noise"""
    lean_q: FloatArray
    """(n, 2) the same on q"""
    residual_p: FloatArray
    """(n,) squared deviation of the fraction over p from the linear function that `lean_p` tells"""
    residual_q: FloatArray
    """(n,) the same on q"""


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
            size += (corners[k, axis] - corners[k + 2, axis]) ** 2 + (other[k, axis] - other[k + 2, axis]) ** 2
    return x * x + y * y + z * z < NEAR * NEAR * size


@kernel
def _quadrant(corners: FloatArray, count: int, y: FloatArray) -> int:
    """Which quadrant of an element (4, 3) a point of it is in: by the halves of two adjacent sides."""
    along = 0.0
    across = 0.0
    last = count - 1
    for axis in range(3):
        du = corners[1, axis] - corners[0, axis] + (corners[2, axis] - corners[3, axis] if count == 4 else 0.0)
        dv = corners[last, axis] - corners[0, axis] + (corners[2, axis] - corners[1, axis] if count == 4 else 0.0)
        middle = 0.0
        for k in range(count):
            middle += corners[k, axis] / count
        along += (y[axis] - middle) * du
        across += (y[axis] - middle) * dv
    return (1 if along > 0.0 else 0) + (2 if across > 0.0 else 0)


@kernel
def _generate(
    p: IntArray,
    q: IntArray,
    samples: int,
    corners: Corners,
    counts: IntArray,
    area: FloatArray,
    patch: IntArray,
    normals: FloatArray,
    axes: FloatArray,
    centroid: Points,
    center: FloatArray,
    scale: float,
    offset: float,
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
        h = hash_index(np.int64(i) * np.int64(1000003) + np.int64(j))
        for axis in range(4):
            shift[axis] = ((h >> (15 * axis)) & 0x7FFF) / 32768.0
        ray = (link - first) * STRATA * samples
        for s in range(STRATA * samples):
            stratum = s % STRATA
            u1 = 0.5 * ((stratum & 1) + (shift[0] + (s + 1) * _STEP[0]) % 1.0)
            v1 = 0.5 * (((stratum >> 1) & 1) + (shift[1] + (s + 1) * _STEP[1]) % 1.0)
            u2 = 0.5 * (((stratum >> 2) & 1) + (shift[2] + (s + 1) * _STEP[2]) % 1.0)
            v2 = 0.5 * (((stratum >> 3) & 1) + (shift[3] + (s + 1) * _STEP[3]) % 1.0)
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
                    a = np.float32((x[axis] - center[axis]) * scale + offset * n1[axis])
                    b = np.float32((y[axis] - center[axis]) * scale + offset * n2[axis])
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


@kernel
def _reduce(
    samples: int,
    first: int,
    p: IntArray,
    q: IntArray,
    moment: FloatArray,
    start: int,
    stop: int,
    weights: FloatArray,
    strata: ByteArray,
    places: Float32Array,
    blocked: BoolArray,
    visibility: FloatArray,
    noise: FloatArray,
    lean_p: FloatArray,
    lean_q: FloatArray,
    residual_p: FloatArray,
    residual_q: FloatArray,
) -> None:
    """Visible fraction, its squared error, and how it varies over either end."""
    weight = np.empty((2, 4))
    seen = np.empty((2, 4))
    mean = np.empty(4)
    seen_mean = np.empty(4)
    n = STRATA * samples
    for link in range(start, stop):
        weight[:] = 0.0
        seen[:] = 0.0
        mean[:] = 0.0
        seen_mean[:] = 0.0
        base = (link - first) * n
        total = 0.0
        square = 0.0
        seen_total = 0.0
        seen_square = 0.0
        for ray in range(base, base + n):
            w = weights[ray]
            a = strata[ray] & 3
            b = strata[ray] >> 2
            total += w
            square += w * w
            weight[0, a] += w
            weight[1, b] += w
            for k in range(4):
                mean[k] += w * places[ray, k]
            if not blocked[ray]:
                seen_total += w
                seen_square += w * w
                seen[0, a] += w
                seen[1, b] += w
                for k in range(4):
                    seen_mean[k] += w * places[ray, k]
        lean_p[link, :] = 0.0
        lean_q[link, :] = 0.0
        if total <= 0.0:
            visibility[link] = 0.5
            noise[link] = 0.25
            residual_p[link] = 0.25
            residual_q[link] = 0.25
            continue
        v = seen_total / total
        visibility[link] = v
        # Of a ratio of sums, to first order; and one sample of the other kind may have been missed.
        scatter = ((1.0 - 2.0 * v) * seen_square + v * v * square) / (total * total)
        effective = total * total / square
        missed = MISSED / (effective + 1.0)
        noise[link] = STRATIFIED * (max(0.0, scatter) + missed * missed)
        scattered = STRATIFIED * v * (1.0 - v) / effective
        for end in range(2):
            # Between-quadrant variance less what a quarter of the samples scatter by themselves, and at
            # least the error of the whole estimate.
            spread = 0.0
            for k in range(4):
                if weight[end, k] > 0.0:
                    spread += weight[end, k] / total * (seen[end, k] / weight[end, k] - v) ** 2
            spread = max(spread - 3.0 * scattered, 0.5 * scattered)
            # The linear part, shrunk by what noise alone would give.
            u0 = (seen_mean[2 * end] - v * mean[2 * end]) / total
            v0 = (seen_mean[2 * end + 1] - v * mean[2 * end + 1]) / total
            s = moment[q[link]] if end == 1 else moment[p[link]]
            determinant = s[0] * s[2] - s[1] * s[1]
            linear = (s[2] * u0 * u0 - 2.0 * s[1] * u0 * v0 + s[0] * v0 * v0) / determinant
            keep = max(0.0, 1.0 - 2.0 * scattered / linear) if linear > 0.0 else 0.0
            lean = lean_q if end == 1 else lean_p
            lean[link, 0] = keep * u0
            lean[link, 1] = keep * v0
            residual = residual_q if end == 1 else residual_p
            residual[link] = max(spread - keep * linear, STEP * spread)


def visible_fractions(
    rays: RayScene,
    p: IntArray,
    q: IntArray,
    corners: Corners,
    counts: IntArray,
    area: FloatArray,
    patch: IntArray,
    normals: FloatArray,
    axes: FloatArray,
    centroid: Points,
    moment: FloatArray,
    samples: int = 1,
) -> VisibleFractions:
    """Visible fractions of element pairs p, q (n,), of the light paths between them, by 16 `samples` rays each.

    corners (m, 4, 3), counts (m,), area (m,), patch (m,), centroid (m, 3) and second moments (m, 3) are the
    elements', normals (k, 3) and axes (k, 2, 3) the patches'.
    """
    n = len(p)
    result = VisibleFractions(
        np.empty(n), np.empty(n), np.empty((n, 2)), np.empty((n, 2)), np.empty(n), np.empty(n)
    )
    links_at_once = max(1, BATCH // (STRATA * samples))
    for first in range(0, n, links_at_once):
        last = min(first + links_at_once, n)
        count = (last - first) * STRATA * samples
        origins = np.empty((count, 3), dtype=np.float32)
        directions = np.empty((count, 3), dtype=np.float32)
        weights = np.empty(count)
        strata = np.empty(count, dtype=np.uint8)
        places = np.empty((count, 4), dtype=np.float32)

        def generate(
            start: int,
            stop: int,
            first: int = first,
            origins: Float32Array = origins,
            directions: Float32Array = directions,
            weights: FloatArray = weights,
            strata: ByteArray = strata,
            places: Float32Array = places,
        ) -> None:
            _generate(
                p,
                q,
                samples,
                corners,
                counts,
                area,
                patch,
                normals,
                axes,
                centroid,
                rays.center,
                rays.scale,
                rays.offset,
                first,
                first + start,
                first + stop,
                origins,
                directions,
                weights,
                strata,
                places,
            )

        run_chunks(generate, last - first, _CHUNK)
        blocked = rays.occluded_local(origins, directions)
        _reduce(
            samples,
            first,
            p,
            q,
            moment,
            first,
            last,
            weights,
            strata,
            places,
            blocked,
            result.visibility,
            result.noise,
            result.lean_p,
            result.lean_q,
            result.residual_p,
            result.residual_q,
        )
    return result
