"""The estimated error of the field, link by link, and the light that it depends on ([H 4.4.1])."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.parallel import run_chunks
from solver.transport.excess import excess_light
from solver.transport.linking import Light
from solver.transport.links import LinkBatch
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
from solver.types import FloatArray, IntArray

LEAF: Final = 0.2
"""Part of the residuals within a leaf that counts as error: its mean is right all the same."""


SAFETY: Final = 1.25
"""Factor on the estimate: errors that it does not know, such as of visibility that all rays agree on."""


@dataclass(frozen=True)
class ErrorParts:
    """What the estimated relative error comes from; squares add up."""

    coarseness: float = 1.0
    """Links that are not subdivided"""
    noise: float = 1.0
    """Visibility that few rays tell"""


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Where the error is."""

    links: FloatArray
    """(3, n) squared luminance error, times area, that each remedy would resolve: split p, split q,
    resample"""
    irradiance: FloatArray
    """(n,) luminance irradiance, W/m2, by which a link errs at either end, at most"""
    light: Light
    """of the elements"""
    norm: float
    """squared luminance of what is reflected, times area; NaN where it was not asked for"""

    @property
    def relative(self) -> float:
        """Relative error of the reflected radiosity, 0 to 1."""
        if self.norm <= 0.0:
            return 0.0
        return min(1.0, SAFETY * float(np.sqrt(self.links.sum() / self.norm)))

    @property
    def parts(self) -> ErrorParts:
        """The same by its causes; needs the norm."""
        if self.norm <= 0.0:
            return ErrorParts(0.0, 0.0)
        noise, split = float(self.links[RESAMPLE].sum()), float(self.links[SPLIT_P].sum())
        split += float(self.links[SPLIT_Q].sum())
        coarseness, noise = (SAFETY * math.sqrt(part / self.norm) for part in (split, noise))
        return ErrorParts(min(1.0, coarseness), min(1.0, noise))


@dataclass(frozen=True, eq=False)
class Residuals:
    """What the errors of links depend on; luminance, n elements."""

    light: Light
    spread: FloatArray
    """(n,) RMS residual of the radiosity from its linear function, W/m2"""
    amplitude: FloatArray
    """(n,) sum over an element's own links of what they bring and its function leaves out, W/m2"""
    bias: FloatArray
    """(n,) error of the mean radiosity if the residuals of all sources err to one side, W/m2"""
    excess: FloatArray
    """(n,) of what is sent where it cannot arrive: `excess_light`, (W/m2)^2"""

    @staticmethod
    def of(state: TransportState, with_excess: bool = True) -> Residuals:
        """As the light stands, with what is sent where it cannot arrive, or without."""
        tree, links = state.tree, state.links
        luminance = state.radiosity @ state.weights
        moments = np.empty((len(tree), 3, 1))
        pull(
            tree.child, tree.child_count, tree.area, tree.moment, tree.offset, luminance[:, :, None], moments
        )
        mean = np.maximum(moments[:, 0, 0], 0.0)
        reflectance = (state.reflectance @ state.weights)[tree.patch]
        variance, spread = np.empty((2, len(tree)))
        ends = links.p, links.q, links.residual_p, links.residual_q
        amplitude = arriving_amplitudes(*ends, reflectance, mean)
        leaf_residuals(tree.parent, tree.area, amplitude, variance)
        element_residuals(
            tree.child, tree.child_count, tree.area, tree.moment, moments[:, :, 0], variance, spread
        )
        bias = leaving_bias(*ends, tree, reflectance, spread)
        excess = excess_light(tree, links, mean) if with_excess else np.zeros(len(tree))
        return Residuals(Light(mean, reflectance, 0.0), spread, amplitude, bias, excess)

    def grown(self, state: TransportState, fresh: IntArray) -> Residuals:
        """As these, with elements that came since, when links `fresh` did.

        They have their parents' residuals, but what arrives over their own links.
        """
        tree, links = state.tree, state.links
        n = len(self.spread)
        parent = tree.parent[n:]
        reflectance = np.concatenate([self.light.reflectance, self.light.reflectance[parent]])
        mean = np.concatenate([self.light.radiosity, np.maximum(state.radiosity[n:, 0] @ state.weights, 0.0)])
        arriving = arriving_amplitudes(
            links.p[fresh],
            links.q[fresh],
            links.residual_p[fresh],
            links.residual_q[fresh],
            reflectance,
            mean,
        )
        return Residuals(
            Light(mean, reflectance, 0.0),
            np.concatenate([self.spread, self.spread[parent]]),
            np.concatenate([self.amplitude, arriving[n:]]),
            np.concatenate([self.bias, self.bias[parent]]),
            np.concatenate([self.excess, self.excess[parent]]),
        )

    def estimate(self, state: TransportState, links: LinkBatch | IntArray | None = None) -> ErrorEstimate:
        """The errors of the given links or rows of links (n,), without the norm, or of all, with it.

        Emission is known and would only dilute a relative error, so that the norm leaves it out.
        """
        tree, norm = state.tree, math.nan
        leaf = tree.child < 0
        if links is None:
            reflected = state.radiosity[leaf, 0] @ state.weights
            reflected -= (state.emission @ state.weights)[tree.patch[leaf]]
            norm = float((tree.area[leaf] * reflected**2).sum())
        resolved = np.where(leaf, LEAF, 1.0)
        told = links if isinstance(links, LinkBatch) else state.links
        rows = links if isinstance(links, np.ndarray) else slice(None)
        p, q, exchange, noise = told.p[rows], told.q[rows], told.open_exchange[rows], told.noise[rows]
        residual_p, residual_q = told.residual_p[rows], told.residual_q[rows]
        kind, visibility = told.kind[rows], told.visibility[rows]
        errors, irradiance = np.empty((3, len(p))), np.empty(len(p))
        mean, reflectance = self.light.radiosity, self.light.reflectance

        def work(start: int, stop: int) -> None:
            link_errors(
                p, q, kind, exchange, visibility, noise, residual_p, residual_q, tree.area, reflectance, mean,
                self.spread, resolved, self.amplitude, self.bias, self.excess, start, stop, errors[SPLIT_P],
                errors[SPLIT_Q], errors[RESAMPLE], irradiance,
            )  # fmt: skip

        run_chunks(work, len(p), 1 << 15, 1 << 12)
        return ErrorEstimate(links=errors, irradiance=irradiance, light=self.light, norm=norm)


def estimate_error(state: TransportState) -> ErrorEstimate:
    """The error of the field as it stands."""
    return Residuals.of(state).estimate(state)
