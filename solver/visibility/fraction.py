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
from solver.types import BoolArray, Corners, Float32Array, FloatArray, IntArray
from solver.visibility.rays import RayScene

STRATA: Final = 16
"""Quadrant pairs of a link."""

STRATIFIED: Final = 0.5
"""Variance of a stratified sample relative to that of a random one."""

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
def _hash(x: int) -> int:
    h = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x7F4A7C15)
    h ^= h >> np.uint64(32)
    h *= np.uint64(0xD6E8FEB86659FD93)
    h ^= h >> np.uint64(32)
    h *= np.uint64(0xD6E8FEB86659FD93)
    h ^= h >> np.uint64(32)
    return np.int64(h >> np.uint64(1))


@kernel
def sample_element(
    corners: FloatArray, count: int, normal: FloatArray, area: float, u: float, v: float, out: FloatArray
) -> float:
    """Point of an element (4, 3) at (u, v) in the unit square, into out (3,); returns its area weight.

    The weight is the Jacobian of the map: over the unit square its mean is the element's area.
    """
    if count == 3:
        r = math.sqrt(u)
        a = 1.0 - r
        b = r * (1.0 - v)
        c = r * v
        for axis in range(3):
            out[axis] = a * corners[0, axis] + b * corners[1, axis] + c * corners[2, axis]
        return area
    sx = (1.0 - v) * (corners[1, 0] - corners[0, 0]) + v * (corners[2, 0] - corners[3, 0])
    sy = (1.0 - v) * (corners[1, 1] - corners[0, 1]) + v * (corners[2, 1] - corners[3, 1])
    sz = (1.0 - v) * (corners[1, 2] - corners[0, 2]) + v * (corners[2, 2] - corners[3, 2])
    tx = (1.0 - u) * (corners[3, 0] - corners[0, 0]) + u * (corners[2, 0] - corners[1, 0])
    ty = (1.0 - u) * (corners[3, 1] - corners[0, 1]) + u * (corners[2, 1] - corners[1, 1])
    tz = (1.0 - u) * (corners[3, 2] - corners[0, 2]) + u * (corners[2, 2] - corners[1, 2])
    wa = (1.0 - u) * (1.0 - v)
    wb = u * (1.0 - v)
    wc = u * v
    wd = (1.0 - u) * v
    for axis in range(3):
        out[axis] = (
            wa * corners[0, axis] + wb * corners[1, axis] + wc * corners[2, axis] + wd * corners[3, axis]
        )
    return (
        (sy * tz - sz * ty) * normal[0] + (sz * tx - sx * tz) * normal[1] + (sx * ty - sy * tx) * normal[2]
    )


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
) -> None:
    """Rays of links [start, stop); row 0 of the outputs belongs to link `first`."""
    x = np.empty(3)
    y = np.empty(3)
    shift = np.empty(4)
    for link in range(start, stop):
        i = p[link]
        j = q[link]
        n1 = normals[patch[i]]
        n2 = normals[patch[j]]
        h = _hash(np.int64(i) * np.int64(1000003) + np.int64(j))
        for axis in range(4):
            shift[axis] = ((h >> (15 * axis)) & 0x7FFF) / 32768.0
        ray = (link - first) * STRATA * samples
        for s in range(STRATA * samples):
            stratum = s % STRATA
            u1 = 0.5 * ((stratum & 1) + (shift[0] + (s + 1) * _STEP[0]) % 1.0)
            v1 = 0.5 * (((stratum >> 1) & 1) + (shift[1] + (s + 1) * _STEP[1]) % 1.0)
            u2 = 0.5 * (((stratum >> 2) & 1) + (shift[2] + (s + 1) * _STEP[2]) % 1.0)
            v2 = 0.5 * (((stratum >> 3) & 1) + (shift[3] + (s + 1) * _STEP[3]) % 1.0)
            weight = sample_element(corners[i], counts[i], n1, area[i], u1, v1, x) * sample_element(
                corners[j], counts[j], n2, area[j], u2, v2, y
            )
            square = 0.0
            cosine1 = 0.0
            cosine2 = 0.0
            for axis in range(3):
                d = y[axis] - x[axis]
                square += d * d
                cosine1 += d * n1[axis]
                cosine2 -= d * n2[axis]
            if square > 0.0 and cosine1 > 0.0 and cosine2 > 0.0:
                weights[ray] = weight * cosine1 * cosine2 / (math.pi * square * square)
            else:
                weights[ray] = 0.0
            for axis in range(3):
                a = np.float32((x[axis] - center[axis]) * scale + offset * n1[axis])
                b = np.float32((y[axis] - center[axis]) * scale + offset * n2[axis])
                origins[ray, axis] = a
                directions[ray, axis] = b - a
            ray += 1


@kernel
def _reduce(
    samples: int,
    first: int,
    start: int,
    stop: int,
    exchange: FloatArray,
    weights: FloatArray,
    blocked: BoolArray,
    visibility: FloatArray,
    noise: FloatArray,
    spread_p: FloatArray,
    spread_q: FloatArray,
) -> None:
    """Visible fraction, its squared error, and its squared deviation between the quadrants of either end.

    The kernel of close pairs is peaked, and the ratio of sampled sums would be biased by the peaks that
    few samples miss. The exchange area is known, so that the lesser of the visible and the blocked part
    is measured in absolute terms, without bias, and the other is the rest.
    """
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
        hidden_square = 0.0
        for s in range(n):
            w = weights[base + s]
            a = (s % STRATA) & 3
            b = (s % STRATA) >> 2
            weight_p[a] += w
            weight_q[b] += w
            if blocked[base + s]:
                hidden_square += w * w
            else:
                seen_square += w * w
                seen_p[a] += w
                seen_q[b] += w
        total = weight_p.sum()
        seen = seen_p.sum()
        scale = 1.0 / (n * exchange[link])
        if 2.0 * seen <= total:
            v = min(1.0, seen * scale)
            square = seen_square
            part = seen
        else:
            v = max(0.0, 1.0 - (total - seen) * scale)
            square = hidden_square
            part = total - seen
        visibility[link] = v
        # One sample of the other kind may have been missed.
        missed = 0.5 / (n + 1.0)
        scatter = max(0.0, square * n - part * part) * scale * scale / n
        noise[link] = STRATIFIED * (scatter + missed * missed / n)
        spread_p[link] = 0.0
        spread_q[link] = 0.0
        if total <= 0.0:
            continue
        # Between-quadrant variance less what 4 samples a quadrant scatter by themselves, and at least
        # the error of the whole estimate.
        ratio = seen / total
        scattered = 0.75 * ratio * (1.0 - ratio) / (4.0 * samples)
        for k in range(4):
            if weight_p[k] > 0.0:
                spread_p[link] += weight_p[k] / total * (seen_p[k] / weight_p[k] - ratio) ** 2
            if weight_q[k] > 0.0:
                spread_q[link] += weight_q[k] / total * (seen_q[k] / weight_q[k] - ratio) ** 2
        spread_p[link] = max(spread_p[link] - scattered, 0.25 * scattered)
        spread_q[link] = max(spread_q[link] - scattered, 0.25 * scattered)


def visible_fractions(
    rays: RayScene,
    p: IntArray,
    q: IntArray,
    exchange: FloatArray,
    corners: Corners,
    counts: IntArray,
    area: FloatArray,
    patch: IntArray,
    normals: FloatArray,
    samples: int = 1,
) -> VisibleFractions:
    """Visible fractions of element pairs p, q (n,) with unoccluded exchange areas (n,) > 0.

    By 16 `samples` rays each. corners (m, 4, 3), counts (m,), area (m,), patch (m,) are the elements',
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

        def generate(
            start: int,
            stop: int,
            first: int = first,
            origins: Float32Array = origins,
            directions: Float32Array = directions,
            weights: FloatArray = weights,
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
            )

        run_chunks(generate, last - first, _CHUNK)
        blocked = rays.occluded_local(origins, directions)
        _reduce(
            samples,
            first,
            first,
            last,
            exchange,
            weights,
            blocked,
            result.visibility,
            result.noise,
            result.spread_p,
            result.spread_q,
        )
    return result
