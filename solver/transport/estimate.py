"""The estimated error of the field, link by link, and the light that it depends on ([H 4.4.1])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.parallel import run_chunks
from solver.transport.linking import Light
from solver.transport.oracle import (
    RESAMPLE,
    SPLIT_P,
    SPLIT_Q,
    arriving_amplitudes,
    element_residuals,
    leaf_residuals,
    leaving_bias,
    link_errors,
)
from solver.transport.pushpull import pull
from solver.transport.state import TransportState
from solver.types import FloatArray

LEAF: Final = 0.2
"""Part of the residuals within a leaf that counts as error: its mean is right all the same."""


SAFETY: Final = 1.25
"""Factor on the estimate: errors that it does not know, such as of visibility that all rays agree on."""


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Where the error is."""

    links: FloatArray
    """(3, n) squared luminance error, times area, that each remedy would resolve: split p, split q,
    resample"""
    irradiance: FloatArray
    """(n,) luminance irradiance, W/m2, by which a link errs at either end, at most"""
    light: Light
    norm: float
    """squared luminance of what is reflected, times area"""

    @property
    def relative(self) -> float:
        """Relative error of the reflected radiosity, 0 to 1."""
        if self.norm <= 0.0:
            return 0.0
        return min(1.0, SAFETY * float(np.sqrt(self.links.sum() / self.norm)))


def estimate_error(state: TransportState) -> ErrorEstimate:
    """The error of the field as it stands.

    Emission is known and would only dilute a relative error, so that the norm leaves it out.
    """
    tree, links = state.tree, state.links
    luminance = state.radiosity @ state.weights
    moments = np.empty((len(tree), 3, 1))
    pull(tree.child, tree.child_count, tree.area, tree.moment, tree.offset, luminance[:, :, None], moments)
    mean = np.maximum(moments[:, 0, 0], 0.0)
    reflectance = (state.reflectance @ state.weights)[tree.patch]
    amplitude, variance, spread, bias = np.empty((4, len(tree)))
    arriving_amplitudes(links.p, links.q, links.residual_p, links.residual_q, reflectance, mean, amplitude)
    leaf_residuals(tree.parent, tree.area, amplitude, variance)
    element_residuals(
        tree.child, tree.child_count, tree.area, tree.moment, moments[:, :, 0], variance, spread
    )
    leaving_bias(
        links.p, links.q, links.residual_p, links.residual_q, tree.parent, tree.child, tree.child_count,
        tree.area, reflectance, spread, bias,
    )  # fmt: skip
    leaf = tree.child < 0
    resolved = np.where(leaf, LEAF, 1.0)
    errors = np.empty((3, len(links)))

    def work(start: int, stop: int) -> None:
        link_errors(
            links.p, links.q, links.open_exchange, links.noise, links.residual_p, links.residual_q, tree.area,
            reflectance, mean, spread, resolved, amplitude, bias, start, stop, errors[SPLIT_P],
            errors[SPLIT_Q], errors[RESAMPLE],
        )  # fmt: skip

    run_chunks(work, len(links), 1 << 15, 1 << 12)
    reflected = luminance[leaf, 0] - (state.emission @ state.weights)[tree.patch[leaf]]
    return ErrorEstimate(
        links=errors,
        irradiance=np.maximum(mean[links.q] * links.residual_p, mean[links.p] * links.residual_q),
        light=Light(mean, reflectance, 0.0),
        norm=float((tree.area[leaf] * reflected**2).sum()),
    )
