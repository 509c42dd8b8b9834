"""Where refinement pays: each link's squared error, by the end whose subdivision would reduce it.

Transport-based refinement [H 4.4.1], with errors as the squares that add up to the RMS error of the
field. Links carry linear functions (`pushpull`), so that errors come from what is not linear:

* arriving: light from q falls on p with a residual that no linear function over p shows. Subdividing p
  resolves it;
* leaving: p sends q its mean and first moment; where its radiosity has a residual and the form factor
  over p has one too, they are taken as fully correlated. Subdividing p resolves it;
* sampling: the visible fraction is known from rays. More rays resolve it.

Errors of links that share a receiver tend to have one sign (where two surfaces come close, links from
all parts of the one err alike on the other), so that they add up by amplitude at each element, and by
squares over elements and levels. If they added up by squares alone, subdividing a source would seem to
improve its receiver.

[H] splits the larger end; here the end with the larger error is split, which is the same for emitters
and reflectors alike but never splits a uniform lamp in vain.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.transport.elements import ElementTree
from solver.transport.sums import add_up
from solver.transport.variation import solve_moment
from solver.types import BoolArray, FloatArray, Int64Array, IntArray
from solver.visibility.fraction import STRATIFIED
from solver.visibility.shafts import PARTIAL

SPLIT_P: Final = 0
SPLIT_Q: Final = 1
RESAMPLE: Final = 2
"""What can be done about a link's error."""

MAX_SAMPLES: Final = 256
"""Most samples a link takes, 16 rays each."""


@kernel
def _add_arriving(
    p: IntArray,
    q: IntArray,
    residual_p: FloatArray,
    residual_q: FloatArray,
    reflectance: FloatArray,
    radiosity: FloatArray,
    start: int,
    stop: int,
    amplitude: FloatArray,
) -> None:
    for link in range(start, stop):
        i = p[link]
        j = q[link]
        amplitude[i] += reflectance[i] * radiosity[j] * residual_p[link]
        amplitude[j] += reflectance[j] * radiosity[i] * residual_q[link]


def arriving_amplitudes(
    p: IntArray,
    q: IntArray,
    residual_p: FloatArray,
    residual_q: FloatArray,
    reflectance: FloatArray,
    radiosity: FloatArray,
) -> FloatArray:
    """Sum over its own links of the RMS radiosity that an element's (n,) function leaves out, W/m2.

    p, q, residual_p, residual_q (m,) are of the links; luminance reflectance and radiosity (n,).
    """

    def add(start: int, stop: int, amplitude: FloatArray) -> None:
        _add_arriving(p, q, residual_p, residual_q, reflectance, radiosity, start, stop, amplitude)

    return add_up(add, len(p), reflectance.shape)


@kernel
def leaf_residuals(parent: IntArray, area: FloatArray, amplitude: FloatArray, variance: FloatArray) -> None:
    """Variance of the radiosity within each element (n,) that no linear function shows, (W/m2)^2.

    What a link brings to an ancestor varies over a descendant in proportion to its length at most.
    """
    for e in range(len(variance)):
        variance[e] = amplitude[e] * amplitude[e]
        if parent[e] >= 0:
            variance[e] += variance[parent[e]] * area[e] / area[parent[e]]


@kernel
def element_residuals(
    child: IntArray,
    child_count: IntArray,
    area: FloatArray,
    moment: FloatArray,
    moments: FloatArray,
    variance: FloatArray,
    spread: FloatArray,
) -> None:
    """RMS residual of the luminance radiosity over each element (n,) from its linear function.

    moments (n, 3) are mean and first moments; variance (n,) what is unknown within each leaf.
    """
    for e in range(len(child) - 1, -1, -1):
        a, b = solve_moment(moment[e], moments[e, 1], moments[e, 2])
        linear = a * moments[e, 1] + b * moments[e, 2]
        if child[e] < 0:
            spread[e] = linear + variance[e]
            continue
        total = 0.0
        for k in range(child[e], child[e] + child_count[e]):
            total += area[k] * (spread[k] + (moments[k, 0] - moments[e, 0]) ** 2)
        spread[e] = total / area[e]
    # So far it is the whole variance; parents needed that of their children.
    for e in range(len(child)):
        a, b = solve_moment(moment[e], moments[e, 1], moments[e, 2])
        linear = a * moments[e, 1] + b * moments[e, 2]
        spread[e] = math.sqrt(max(0.0, spread[e] - linear))


@kernel
def _add_leaving(
    p: IntArray,
    q: IntArray,
    residual_p: FloatArray,
    residual_q: FloatArray,
    area: FloatArray,
    reflectance: FloatArray,
    spread: FloatArray,
    start: int,
    stop: int,
    bias: FloatArray,
) -> None:
    for link in range(start, stop):
        i = p[link]
        j = q[link]
        bias[j] += reflectance[j] * spread[i] * residual_p[link] * (area[i] / area[j])
        bias[i] += reflectance[i] * spread[j] * residual_q[link] * (area[j] / area[i])


@kernel
def _share_bias(
    parent: IntArray, child: IntArray, child_count: IntArray, area: FloatArray, bias: FloatArray
) -> None:
    """Let elements err by what their ancestors do too, and then by the mean of their children."""
    for e in range(len(bias)):
        if parent[e] >= 0:
            bias[e] += bias[parent[e]]
    for e in range(len(bias) - 1, -1, -1):
        if child[e] >= 0:
            bias[e] = 0.0
            for k in range(child[e], child[e] + child_count[e]):
                bias[e] += bias[k] * area[k] / area[e]


def leaving_bias(
    p: IntArray,
    q: IntArray,
    residual_p: FloatArray,
    residual_q: FloatArray,
    tree: ElementTree,
    reflectance: FloatArray,
    spread: FloatArray,
) -> FloatArray:
    """Mean radiosity error of each element (n,) if the residuals of all its sources err to one side, W/m2.

    p, q, residual_p, residual_q (m,) are of the links; luminance reflectance and residuals (n,).
    """

    def add(start: int, stop: int, bias: FloatArray) -> None:
        _add_leaving(p, q, residual_p, residual_q, tree.area, reflectance, spread, start, stop, bias)

    bias = add_up(add, len(p), reflectance.shape)
    _share_bias(tree.parent, tree.child, tree.child_count, tree.area, bias)
    return bias


@kernel
def link_errors(
    p: IntArray,
    q: IntArray,
    kind: IntArray,
    open_exchange: FloatArray,
    visibility: FloatArray,
    noise: FloatArray,
    residual_p: FloatArray,
    residual_q: FloatArray,
    area: FloatArray,
    reflectance: FloatArray,
    radiosity: FloatArray,
    spread: FloatArray,
    resolved: FloatArray,
    amplitude: FloatArray,
    bias: FloatArray,
    excess: FloatArray,
    start: int,
    stop: int,
    error_p: FloatArray,
    error_q: FloatArray,
    error_v: FloatArray,
    irradiance: FloatArray,
) -> None:
    """Squared luminance error, times area, that splitting p (error_p) or q (error_q) would resolve,
    or sampling the visibility more densely (error_v); and the irradiance by which either end errs at most.

    Per element: area (m2), luminance reflectance, mean luminance radiosity and its residual spread
    (W/m2), the share of arriving residuals that counts, the sums over its links of what arrives and of
    what its sources err, and what it sends in error. Outputs (n,) in (W/m2)^2 m2, and W/m2.
    """
    for link in range(start, stop):
        i = p[link]
        j = q[link]
        error_v[link] = 0.0
        if noise[link] > 0.0:
            error_v[link] = noise[link] * link_weight(
                open_exchange[link],
                area[i],
                area[j],
                reflectance[i],
                reflectance[j],
                radiosity[i],
                radiosity[j],
            )
        arriving = reflectance[i] * radiosity[j] * residual_p[link] * amplitude[i]
        leaving = reflectance[j] * spread[i] * residual_p[link] * (area[i] / area[j]) * bias[j]
        error_p[link] = area[i] * resolved[i] * arriving + area[j] * leaving
        arriving = reflectance[j] * radiosity[i] * residual_q[link] * amplitude[j]
        leaving = reflectance[i] * spread[j] * residual_q[link] * (area[j] / area[i]) * bias[i]
        error_q[link] = area[j] * resolved[j] * arriving + area[i] * leaving
        if kind[link] == PARTIAL:
            # Light that is missing where it is from, or falls on as small a place elsewhere.
            sent = open_exchange[link] * visibility[link] * max(reflectance[i], reflectance[j]) ** 2
            error_p[link] += sent * excess[i]
            error_q[link] += sent * excess[j]
        irradiance[link] = max(radiosity[j] * residual_p[link], radiosity[i] * residual_q[link])


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
    """Samples (1, 4 ... MAX_SAMPLES) per link (n,) that keep the error of one half visible below `limit`."""
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
def best_remedies(
    p: IntArray,
    q: IntArray,
    samples: IntArray,
    splittable: BoolArray,
    irradiance: FloatArray,
    limit: float,
    errors: FloatArray,
    worth: FloatArray,
    action: IntArray,
) -> float:
    """The greatest of each link's `errors` (3, n) that can be resolved, and how; returns the sum left alone.

    Elements may be `splittable` (m,); links that err by no more than `limit` W/m2 (n,) are not split.
    """
    left_alone = 0.0
    for link in range(len(p)):
        split_p = errors[SPLIT_P, link]
        split_q = errors[SPLIT_Q, link]
        if irradiance[link] <= limit:
            left_alone += split_p + split_q
            split_p = 0.0
            split_q = 0.0
        if not splittable[p[link]]:
            split_p = 0.0
        if not splittable[q[link]]:
            split_q = 0.0
        best = split_p
        action[link] = SPLIT_P
        if split_q > best:
            best = split_q
            action[link] = SPLIT_Q
        if errors[RESAMPLE, link] > best and samples[link] < MAX_SAMPLES:
            best = errors[RESAMPLE, link]
            action[link] = RESAMPLE
        worth[link] = best
    return left_alone


@kernel
def _histogram(errors: FloatArray, greatest: float, sums: FloatArray) -> None:
    """Sums of the errors by quarter octaves, the first of them around the greatest.

    Symmetric scenes have many equal errors, which rounding must not part.
    """
    for value in errors:
        if value > 0.0:
            slot = math.floor(0.5 - 4.0 * math.log2(value / greatest))
            sums[min(max(slot, 0), len(sums) - 1)] += value


def threshold_for_share(errors: FloatArray, resolved: float) -> float:
    """The value above which `errors` (n,) sum up to at least `resolved`, to within a quarter octave.

    It is below the greatest error, which must be positive.
    """
    greatest = float(errors.max())
    sums = np.zeros(1024)
    _histogram(errors, greatest, sums)
    slot = int(np.searchsorted(np.cumsum(sums), resolved))
    return greatest * float(2.0 ** (-(min(slot, len(sums) - 1) + 0.5) / 4.0))


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
