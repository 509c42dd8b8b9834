"""Where refinement pays: each link's squared error, by the end whose subdivision would reduce it.

Transport-based refinement [H 4.4.1], with errors as the squares that add up to the RMS error of the
field. Light arriving at p over a link from q varies over p by B_q times the RMS deviation of the form
factor over p (occlusion included, see `linking`): subdividing p resolves it. Light leaving p for q is
taken as uniform over p: where it is not, and the form factor varies over p too, subdividing p resolves
that. [H] splits the larger end; here the end with the larger error is split, which is the same for
emitters and reflectors alike but never splits a uniform lamp in vain.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.types import FloatArray, Int64Array, IntArray
from solver.visibility.fraction import STRATIFIED

import os
COHERENCE=float(os.environ.get('COH','0.5'))
SPLIT_P: Final = 0
SPLIT_Q: Final = 1
RESAMPLE: Final = 2
"""What can be done about a link's error."""

MAX_SAMPLES: Final = 64
"""Most samples a link takes, 16 rays each."""


@kernel
def link_errors(
    p: IntArray,
    q: IntArray,
    open_exchange: FloatArray,
    noise: FloatArray,
    deviation_p: FloatArray,
    deviation_q: FloatArray,
    area: FloatArray,
    reflectance: FloatArray,
    radiosity: FloatArray,
    spread: FloatArray,
    resolved: FloatArray,
    bias: FloatArray,
    start: int,
    stop: int,
    error_p: FloatArray,
    error_q: FloatArray,
    error_v: FloatArray,
) -> None:
    """Squared luminance error, times area, that splitting p (error_p) or q (error_q) would resolve,
    or sampling the visibility more densely (error_v).

    Per element: area (m2), luminance reflectance, mean luminance radiosity and its RMS spread over the
    element as far as its descendants tell (W/m2). Outputs (n,) in (W/m2)^2 m2.
    """
    for link in range(start, stop):
        i = p[link]
        j = q[link]
        error_v[link] = 0.0
        if noise[link] > 0.0:
            error_v[link] = noise[link] * link_weight(
                open_exchange[link], area[i], area[j], reflectance[i], reflectance[j], radiosity[i], radiosity[j]
            )
        arriving = reflectance[i] * radiosity[j] * deviation_p[link] * resolved[i]
        leaving = COHERENCE * reflectance[j] * spread[i] * deviation_p[link] * (area[i] / area[j])
        error_p[link] = area[i] * arriving * arriving + area[j] * leaving * bias[j]
        arriving = reflectance[j] * radiosity[i] * deviation_q[link] * resolved[j]
        leaving = COHERENCE * reflectance[i] * spread[j] * deviation_q[link] * (area[j] / area[i])
        error_q[link] = area[j] * arriving * arriving + area[i] * leaving * bias[i]


@kernel
def link_weight(
    exchange: float,
    area_p: float,
    area_q: float,
    reflectance_p: float,
    reflectance_q: float,
    radiosity_p: float,
    radiosity_q: float,
) -> float:
    """Squared luminance, times area, that a link brings to its two ends: what its visibility multiplies."""
    to_p = exchange * radiosity_q * reflectance_p
    to_q = exchange * radiosity_p * reflectance_q
    return to_p * to_p / area_p + to_q * to_q / area_q


@kernel
def samples_needed(
    p: IntArray,
    q: IntArray,
    exchange: FloatArray,
    area: FloatArray,
    reflectance: FloatArray,
    radiosity: FloatArray,
    limit: float,
    out: IntArray,
) -> None:
    """Samples (1, 4, 16, 64) per link (n,) that keep the error of a half-visible one below `limit`."""
    for link in range(len(p)):
        i = p[link]
        j = q[link]
        weight = link_weight(
            exchange[link], area[i], area[j], reflectance[i], reflectance[j], radiosity[i], radiosity[j]
        )
        samples = 1
        while samples < MAX_SAMPLES and 0.25 * STRATIFIED * weight > limit * 16.0 * samples:
            samples *= 4
        out[link] = samples


@kernel
def _histogram(errors: FloatArray, sums: FloatArray) -> None:
    for value in errors:
        if value > 0.0:
            slot = math.floor(4.0 * math.log2(value)) + len(sums) // 2
            sums[min(max(slot, 0), len(sums) - 1)] += value


def threshold_for_share(errors: FloatArray, resolved: float) -> float:
    """The value above which `errors` (n,) sum up to at least `resolved`, to within a quarter octave."""
    sums = np.zeros(4096)
    _histogram(errors, sums)
    from_top = np.cumsum(sums[::-1])
    slot = len(sums) - 1 - int(np.searchsorted(from_top, resolved))
    return float(2.0 ** ((max(slot, 0) - len(sums) // 2) / 4.0))


@kernel
def leaf_variance(
    p: IntArray,
    q: IntArray,
    deviation_p: FloatArray,
    deviation_q: FloatArray,
    parent: IntArray,
    area: FloatArray,
    reflectance: FloatArray,
    radiosity: FloatArray,
    variance: FloatArray,
) -> None:
    """Variance of the luminance radiosity within each element, by what its links bring, (n,) (W/m2)^2.

    Contributions of different links are taken as independent; what varies linearly over an ancestor
    varies over a descendant in proportion to its length, so that variance is handed down by area.
    """
    for e in range(len(variance)):
        variance[e] = 0.0
    for link in range(len(p)):
        i = p[link]
        j = q[link]
        variance[i] += (reflectance[i] * radiosity[j] * deviation_p[link]) ** 2
        variance[j] += (reflectance[j] * radiosity[i] * deviation_q[link]) ** 2
    for e in range(len(variance)):
        if parent[e] >= 0:
            variance[e] += variance[parent[e]] * area[e] / area[parent[e]]


@kernel
def element_spread(
    child: IntArray,
    child_count: IntArray,
    area: FloatArray,
    mean: FloatArray,
    variance: FloatArray,
    spread: FloatArray,
) -> None:
    """RMS spread of the radiosity over each element (n,): of the leaves below it and within them."""
    for e in range(len(child) - 1, -1, -1):
        if child[e] < 0:
            spread[e] = math.sqrt(variance[e])
            continue
        total = 0.0
        for k in range(child[e], child[e] + child_count[e]):
            total += area[k] * (spread[k] * spread[k] + (mean[k] - mean[e]) ** 2)
        spread[e] = math.sqrt(total / area[e])


@kernel
def coherent_bias(
    p: IntArray,
    q: IntArray,
    deviation_p: FloatArray,
    deviation_q: FloatArray,
    parent: IntArray,
    child: IntArray,
    child_count: IntArray,
    area: FloatArray,
    reflectance: FloatArray,
    spread: FloatArray,
    bias: FloatArray,
) -> None:
    """Mean radiosity error of each element (n,) if the errors of unresolved sources all have one sign.

    They tend to: where two surfaces come close both are brighter, or both darker, than on average, so
    that taking either as uniform errs to the same side link after link.
    """
    for e in range(len(bias)):
        bias[e] = 0.0
    for link in range(len(p)):
        i = p[link]
        j = q[link]
        bias[j] += COHERENCE * reflectance[j] * spread[i] * deviation_p[link] * (area[i] / area[j])
        bias[i] += COHERENCE * reflectance[i] * spread[j] * deviation_q[link] * (area[j] / area[i])
    for e in range(len(bias)):
        if parent[e] >= 0:
            bias[e] += bias[parent[e]]
    for e in range(len(bias) - 1, -1, -1):
        if child[e] >= 0:
            bias[e] = 0.0
            for k in range(child[e], child[e] + child_count[e]):
                bias[e] += bias[k] * area[k] / area[e]


@kernel
def child_pairs(
    p: IntArray,
    q: IntArray,
    action: IntArray,
    child: IntArray,
    child_count: IntArray,
    slot: Int64Array,
    out_p: IntArray,
    out_q: IntArray,
    out_link: IntArray,
) -> None:
    """The pairs that replace each link, from slot[link] on: by its action, p or q is split, or neither."""
    for link in range(len(p)):
        at = slot[link]
        if action[link] == RESAMPLE:
            out_p[at] = p[link]
            out_q[at] = q[link]
            out_link[at] = link
            continue
        e = p[link] if action[link] == SPLIT_P else q[link]
        for k in range(child_count[e]):
            out_p[at + k] = child[e] + k if action[link] == SPLIT_P else p[link]
            out_q[at + k] = q[link] if action[link] == SPLIT_P else child[e] + k
            out_link[at + k] = link
