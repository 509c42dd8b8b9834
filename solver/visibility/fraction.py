"""How much two elements see of each other: rays between strata of both, through Embree.

A pair is sampled by 16 s rays, from quadrant to quadrant (`pair_rays`). The strata tell not only the
visible fraction, weighted by the transport kernel, but also how it differs from quadrant to quadrant of
either end: how much there is to gain from subdividing it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import BoolArray, ByteArray, Corners, Float32Array, FloatArray, Int64Array, IntArray, Points
from solver.visibility.pair_rays import STRATA, generate_rays
from solver.visibility.rays import RayScene

STRATIFIED: Final = 0.75
"""Variance of a stratified sample relative to that of a random one."""

MISSED: Final = 0.2
"""Part of a sample that may be of the other kind than all that were taken."""

STEP: Final = 0.25
"""Share of the variance of a step that no linear function explains."""

BATCH: Final = 1 << 17
"""Rays generated and traced at a time, which bounds memory."""

_CHUNK: Final = 512
_LEAST: Final = 16


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
    lift: FloatArray,
    centroid: Points,
    moment: FloatArray,
    key: Int64Array,
    samples: int = 1,
) -> VisibleFractions:
    """Visible fractions of the light paths between element pairs p, q (n,), by 16 `samples` rays each.

    corners (m, 4, 3), counts (m,), area (m,), patch (m,), centroid (m, 3) and second moments (m, 3) are the
    elements', as is the key (m,) that their rays go by; normals (k, 3), axes (k, 2, 3) and lift (k,), of
    `ray_lifts`, the patches'.
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
            generate_rays(
                p, q, samples, corners, counts, area, patch, normals, axes, lift, centroid, key, rays.center,
                rays.scale, first, first + start, first + stop, origins, directions, weights, strata, places,
            )  # fmt: skip

        run_chunks(generate, last - first, _CHUNK, max(1, _LEAST // samples))
        blocked = rays.occluded_local(origins, directions)
        _reduce(
            samples, first, p, q, moment, first, last, weights, strata, places, blocked, result.visibility,
            result.noise, result.lean_p, result.lean_q, result.residual_p, result.residual_q,
        )  # fmt: skip
    return result
