"""How much energy a link has at stake: what decides which goes first ([G "Patch importance"]).

The paper ranks patches by what they would shoot at a sample point in the middle of the new object. Links are
finer than patches, and know their form factors but for what has come or gone between their ends.
"""

from __future__ import annotations

import numpy as np

from solver.kernels import kernel
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray, Points


@kernel
def energies_at_stake(
    p: IntArray,
    q: IntArray,
    exchange: FloatArray,
    area: FloatArray,
    centroid: Points,
    patch: IntArray,
    normal: FloatArray,
    radiosity: FloatArray,
    reflectance: FloatArray,
    energy: FloatArray,
) -> None:
    """W (k,) of luminance that pairs of elements p, q (k,) would reflect of each other's light, if unblocked.

    exchange (k,) m2 where it is known, 0 where it is not: then the elements are taken for points, but for
    no more than the smaller one's area. Per element: area, centroid, patch, mean radiosity, reflectance.
    """
    for k in range(len(p)):
        i = p[k]
        j = q[k]
        g = exchange[k]
        if g <= 0.0:
            square = 0.0
            cos_i = 0.0
            cos_j = 0.0
            for axis in range(3):
                d = centroid[j, axis] - centroid[i, axis]
                square += d * d
                cos_i += d * normal[patch[i], axis]
                cos_j -= d * normal[patch[j], axis]
            least = min(area[i], area[j])
            # Large elements see more of each other than their middles do.
            spread = area[i] + area[j]
            cos_i = max(cos_i, 0.0) + 0.25 * np.sqrt(spread)
            cos_j = max(cos_j, 0.0) + 0.25 * np.sqrt(spread)
            g = min(least, area[i] * area[j] * cos_i * cos_j / (np.pi * (square + spread) ** 2))
        energy[k] = g * (radiosity[i] * reflectance[j] + radiosity[j] * reflectance[i])


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
