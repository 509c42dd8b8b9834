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
from solver.types import BoolArray, Corners, Float32Array, FloatArray, IntArray, ByteArray
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
    spread_p: FloatArray
    """(n,) squared deviation of the fraction between the quadrants of p"""
    spread_q: FloatArray
    """(n,) the same of q"""


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
                for axis in range(3):
                    a = np.float32((x[axis] - center[axis]) * scale + offset * n1[axis])
                    b = np.float32((y[axis] - center[axis]) * scale + offset * n2[axis])
                    origins[ray, axis] = a
                    directions[ray, axis] = b - a
            else:
                weights[ray] = 0.0
                strata[ray] = 0
                for axis in range(3):
                    origins[ray, axis] = 0.0
                    directions[ray, axis] = 0.0
            ray += 1


@kernel
def _reduce(
    samples: int,
    first: int,
    start: int,
    stop: int,
    weights: FloatArray,
    strata: ByteArray,
    blocked: BoolArray,
    visibility: FloatArray,
    noise: FloatArray,
    spread_p: FloatArray,
    spread_q: FloatArray,
) -> None:
    """Visible fraction, its squared error, and its squared deviation between the quadrants of either end."""
    weight_p = np.empty(4)
    weight_q = np.empty(4)
    seen_p = np.empty(4)
    seen_q = np.empty(4)
    n = STRATA * samples
    for link in range(start, stop):
        weight_p[:] = 0.0
        weight_q[:] = 0.0
        seen_p[:] = 0.0
        seen_q[:] = 0.0
        base = (link - first) * n
        seen_square = 0.0
        square = 0.0
        for ray in range(base, base + n):
            w = weights[ray]
            a = strata[ray] & 3
            b = strata[ray] >> 2
            weight_p[a] += w
            weight_q[b] += w
            square += w * w
            if not blocked[ray]:
                seen_square += w * w
                seen_p[a] += w
                seen_q[b] += w
        total = weight_p.sum()
        seen = seen_p.sum()
        spread_p[link] = 0.0
        spread_q[link] = 0.0
        if total <= 0.0:
            visibility[link] = 0.5
            noise[link] = 0.25
            continue
        v = seen / total
        visibility[link] = v
        # Of a ratio of sums, to first order; and one sample of the other kind may have been missed.
        scatter = ((1.0 - 2.0 * v) * seen_square + v * v * square) / (total * total)
        effective = total * total / square
        missed = MISSED / (effective + 1.0)
        noise[link] = STRATIFIED * (max(0.0, scatter) + missed * missed)
        # Between-quadrant variance less what 4 samples a quadrant scatter by themselves, and at least
        # the error of the whole estimate.
        scattered = 0.75 * v * (1.0 - v) * 4.0 / effective
        for k in range(4):
            if weight_p[k] > 0.0:
                spread_p[link] += weight_p[k] / total * (seen_p[k] / weight_p[k] - v) ** 2
            if weight_q[k] > 0.0:
                spread_q[link] += weight_q[k] / total * (seen_q[k] / weight_q[k] - v) ** 2
        spread_p[link] = max(spread_p[link] - scattered, 0.25 * scattered)
        spread_q[link] = max(spread_q[link] - scattered, 0.25 * scattered)


def visible_fractions(
    rays: RayScene,
    p: IntArray,
    q: IntArray,
    corners: Corners,
    counts: IntArray,
    area: FloatArray,
    patch: IntArray,
    normals: FloatArray,
    samples: int = 1,
) -> VisibleFractions:
    """Visible fractions of element pairs p, q (n,), of the light paths between them, by 16 `samples` rays each.

    corners (m, 4, 3), counts (m,), area (m,), patch (m,) are the elements',
    normals (k, 3) the patches'.
    """
    n = len(p)
    result = VisibleFractions(np.empty(n), np.empty(n), np.empty(n), np.empty(n))
    links_at_once = max(1, BATCH // (STRATA * samples))
    for first in range(0, n, links_at_once):
        last = min(first + links_at_once, n)
        count = (last - first) * STRATA * samples
        origins = np.empty((count, 3), dtype=np.float32)
        directions = np.empty((count, 3), dtype=np.float32)
        weights = np.empty(count)
        strata = np.empty(count, dtype=np.uint8)

        def generate(
            start: int,
            stop: int,
            first: int = first,
            origins: Float32Array = origins,
            directions: Float32Array = directions,
            weights: FloatArray = weights,
            strata: ByteArray = strata,
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
            )

        run_chunks(generate, last - first, _CHUNK)
        blocked = rays.occluded_local(origins, directions)
        _reduce(
            samples,
            first,
            first,
            last,
            weights,
            strata,
            blocked,
            result.visibility,
            result.noise,
            result.spread_p,
            result.spread_q,
        )
    return result
