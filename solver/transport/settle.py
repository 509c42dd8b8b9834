"""Settling: shoot and gather over the links as they are until nothing is left unshot.

Conjugate gradients on the symmetric form of (I - rho T) B = E, whose preconditioned residual is the
unshot radiosity itself: the search directions are combinations of shots, and Jacobi's iteration
([H 4.3], step 2) is its first step.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

import numpy as np

from solver.transport.state import TransportState
from solver.types import FloatArray

MOST_STEPS: Final = 500


def settle(state: TransportState, target: float) -> Generator[float | None, None, bool]:
    """Work until the unshot radiosity is below `target` of the radiosity, both RMS.

    Yields the unshot share, or None in the midst of a gather.
    Emission does not count as radiosity here: a small bright lamp would outshine all that is unshot.
    Changes the radiosity and the irradiance of `state`. Returns whether the target was met; it is not where
    links in error let light multiply.
    """
    tree = state.tree
    leaf = tree.child < 0
    reflectance = np.where(leaf[:, None], state.reflectance[tree.patch], 0.0)[:, None]
    emission = np.zeros_like(state.radiosity)
    emission[:, 0] = state.emission[tree.patch]
    area = np.where(leaf, tree.area, 0.0)
    active = np.broadcast_to(reflectance > 0.0, emission.shape)
    weight = np.where(
        reflectance > 0.0, area[:, None, None] / np.where(reflectance > 0.0, reflectance, 1.0), 0.0
    )
    state.radiosity[~active] = emission[~active]
    state.received = yield from state.gather_in_steps(state.radiosity)
    unshot = np.where(active, emission + reflectance * state.received - state.radiosity, 0.0)
    direction = unshot.copy()
    energy = _inner(tree.moment, weight, unshot, unshot)
    one = area[:, None, None]
    for _ in range(MOST_STEPS):
        reflected = state.radiosity - emission
        scale = np.sqrt(_inner(tree.moment, one, reflected, reflected).sum())
        left = np.sqrt(_inner(tree.moment, one, unshot, unshot).sum())
        held = float((area[:, None] * np.abs(state.radiosity[:, 0])).sum())
        yield float((area[:, None] * np.abs(unshot[:, 0])).sum()) / max(held, 1e-300)
        if left <= target * scale:
            return True
        arrived = yield from state.gather_in_steps(direction)
        yield None
        moved = np.where(active, direction - reflectance * arrived, 0.0)
        curvature = _inner(tree.moment, weight, direction, moved)
        if np.any((curvature <= 0.0) & (energy > 0.0)):
            return False
        length = _ratio(energy, curvature)
        state.radiosity += length * direction
        state.received += length * arrived
        unshot -= length * moved
        before, energy = energy, _inner(tree.moment, weight, unshot, unshot)
        direction = unshot + _ratio(energy, before) * direction
    return False


def _inner(moment: FloatArray, weight: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Weighted inner product (channels,) of functions (n, 3, channels) over the elements."""
    uu, uv, vv = (moment[:, k, None] for k in range(3))
    along = uu * b[:, 1] + uv * b[:, 2]
    across = uv * b[:, 1] + vv * b[:, 2]
    return np.asarray((weight[:, 0] * (a[:, 0] * b[:, 0] + a[:, 1] * along + a[:, 2] * across)).sum(axis=0))


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    return np.where(below > 0.0, above / np.where(below > 0.0, below, 1.0), 0.0)
