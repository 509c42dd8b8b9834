"""What the light varies by within leaves: the error of pictures that show it as constant or as linear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.kernels import kernel
from solver.transport.oracle import arriving_amplitudes, leaf_residuals
from solver.transport.pushpull import means
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class WithinElements:
    """Luminance radiosity over the n elements, of which only leaves are meaningful; (W/m2)^2."""

    linear: FloatArray
    """(n,) variance of its linear function"""
    residual: FloatArray
    """(n,) variance of what no linear function shows, as far as links tell"""

    @staticmethod
    def of(state: TransportState) -> WithinElements:
        """As the light stands; one pass over all links ([H 4.4.2]'s representation error, in its parts)."""
        tree, links = state.tree, state.links
        reflectance = (state.reflectance @ state.weights)[tree.patch]
        radiosity = np.maximum(means(tree, state.radiosity) @ state.weights, 0.0)
        residual, linear = np.empty((2, len(tree)))
        ends = links.p, links.q, links.residual_p, links.residual_q
        amplitude = arriving_amplitudes(*ends, reflectance, radiosity)
        leaf_residuals(tree.parent, tree.area, amplitude, residual)
        received = state.received @ state.weights
        _linear_variances(tree.moment, received, reflectance, linear)
        return WithinElements(linear, residual)

    def over(self, leaves: IntArray) -> tuple[float, float]:
        """Mean of both over points (k,) that lie on these leaves."""
        return float(self.linear[leaves].mean()), float(self.residual[leaves].mean())


@kernel
def _linear_variances(
    moment: FloatArray, received: FloatArray, reflectance: FloatArray, variance: FloatArray
) -> None:
    """Variance (n,) of linear functions (n, 3) over elements with second moments (n, 3)."""
    for e in range(len(variance)):
        a, b = received[e, 1], received[e, 2]
        spread = a * a * moment[e, 0] + 2.0 * a * b * moment[e, 1] + b * b * moment[e, 2]
        variance[e] = reflectance[e] * reflectance[e] * max(spread, 0.0)
