"""How much a link has at stake: what decides which goes first ([G "Patch importance"]).

The paper ranks patches by what they would shoot at a sample point in the middle of the new object. Links are
finer than patches, and know their form factors but for what has come or gone between their ends; so they are
ranked by how much of the light at their ends the object can have changed, squared, times area: by the
error of the picture, not by watts.
"""

from __future__ import annotations

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.transport.oracle import link_weight
from solver.transport.state import TransportState
from solver.types import BoolArray, FloatArray, IntArray, Points


@kernel
def rank_links(
    p: IntArray,
    q: IntArray,
    exchange: FloatArray,
    area: FloatArray,
    centroid: Points,
    patch: IntArray,
    normal: FloatArray,
    radiosity: FloatArray,
    reflectance: FloatArray,
    boxes: FloatArray,
    known: BoolArray,
    energy: FloatArray,
    share: FloatArray,
    urgency: FloatArray,
    start: int,
    stop: int,
) -> None:
    """W (k,) of luminance that pairs of elements p, q (k,) reflect of each other's light, at most; the share
    (k,) of it that something can have hidden or shown; that, squared, over the area it falls on, (W/m2)^2 m2.

    Of the pairs from start to stop. exchange (l,) m2 of the first ones; of the rest the elements are taken
    for points, but for no more than the smaller one's area. boxes (n, 2, 3): what came or went between the
    ends of the first ones that are `known` (l,); of all others all of the light is at stake. Per element:
    area, centroid, patch, mean radiosity, reflectance.
    """
    for k in range(start, stop):
        i = p[k]
        j = q[k]
        g = exchange[k] if k < len(exchange) else 0.0
        square = 0.0
        cos_i = 0.0
        cos_j = 0.0
        for axis in range(3):
            d = centroid[j, axis] - centroid[i, axis]
            square += d * d
            cos_i += d * normal[patch[i], axis]
            cos_j -= d * normal[patch[j], axis]
        if g <= 0.0:
            spread = area[i] + area[j]
            # Large elements see more of each other than their middles do.
            slack = 0.25 * np.sqrt(spread)
            far = (max(cos_i, 0.0) + slack) * (max(cos_j, 0.0) + slack) / (np.pi * (square + spread) ** 2)
            g = min(area[i], area[j], area[i] * area[j] * far)
        hidden = 1.0
        if k < len(known) and known[k] and len(boxes) > 0:
            hidden = 0.0
            for box in range(len(boxes)):
                hidden = max(
                    hidden,
                    _share_hidden(
                        centroid[i], centroid[j], square, area[i], area[j], boxes[box, 0], boxes[box, 1]
                    ),
                )
        share[k] = hidden
        energy[k] = g * (radiosity[i] * reflectance[j] + radiosity[j] * reflectance[i])
        urgency[k] = link_weight(
            g * hidden, area[i], area[j], reflectance[i], reflectance[j], radiosity[i], radiosity[j]
        )


@inline_kernel
def _share_hidden(
    first: FloatArray,
    second: FloatArray,
    square: float,
    first_area: float,
    second_area: float,
    low: FloatArray,
    high: FloatArray,
) -> float:
    """Part of the light between two elements that a box could hide: its size over that of their shaft."""
    along = 0.0
    for axis in range(3):
        along += (0.5 * (low[axis] + high[axis]) - first[axis]) * (second[axis] - first[axis])
    t = min(1.0, max(0.0, along / max(square, 1e-300)))
    width = (1.0 - t) * np.sqrt(first_area) + t * np.sqrt(second_area)
    x = high[0] - low[0]
    y = high[1] - low[1]
    z = high[2] - low[2]
    # A convex body shows a quarter of its surface on average (Cauchy).
    hidden: float = min(1.0, 0.5 * (x * y + y * z + z * x) / (width * width))
    return hidden


def doubt_of(p: IntArray, q: IntArray, energy: FloatArray, area: FloatArray) -> float:
    """Root of the squared radiosity, times area, that pairs of elements p, q (k,) may bring all together.

    energy (k,) W at stake, of either end. What arrives at an element adds up.
    """
    arriving = np.bincount(p, energy, len(area)) + np.bincount(q, energy, len(area))
    return float(np.sqrt((arriving**2 / area).sum()))


def unshot_square(state: TransportState) -> tuple[float, float]:
    """Squared luminance, times area, of what leaves have received and not sent, and of what they reflect."""
    leaves = state.tree.leaves
    patch = state.tree.patch[leaves]
    received = (state.reflectance[patch] * state.received[leaves, 0]) @ state.weights
    sent = (state.radiosity[leaves, 0] - state.emission[patch]) @ state.weights
    area = state.tree.area[leaves]
    return float((area * (received - sent) ** 2).sum()), float((area * received**2).sum())
