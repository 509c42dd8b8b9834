"""Settling: shoot and gather over the links as they are until nothing is left unshot.

Conjugate gradients on the symmetric form of (I - rho T) B = E, whose preconditioned residual is the
unshot radiosity itself: the search directions are combinations of shots, and Jacobi's iteration
([H 4.3], step 2) is its first step.

What is unshot errs by what becomes of it after all reflections: 1 / (1 - rho) times as much in a closed room
of reflectance rho. How slowly light dies away, the least eigenvalue of I - rho T, is told by the steps
themselves: their lengths and turns make up Lanczos's tridiagonal matrix, whose eigenvalues tend to those of
the operator, the extreme ones first (Golub and Van Loan, Matrix Computations, 10.3).
Later runs, which begin near the end, go by what earlier ones have found.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray, Spectra

MOST_STEPS: Final = 500

ORDINARY_LOSS: Final = 0.3
"""Share of light that a reflection takes away in a room of mid grey. Where it is less, what may be left
unshot is less in proportion."""


def settle(
    state: TransportState, target: float, amplified: bool = True
) -> Generator[float | None, None, bool]:
    """Work until the unshot radiosity is below `target` of the radiosity, both RMS.

    Further where light dies away slowly and what is left unshot comes to more than that, if `amplified`.

    Yields the unshot share, or None in the midst of a gather.
    Emission does not count as radiosity here: a small bright lamp would outshine all that is unshot.
    Changes the radiosity and the irradiance of `state`. Returns whether the target was met; it is not where
    links in error let light multiply.
    """
    tree = state.tree
    leaves = tree.leaves
    patch, emission, reflectance = tree.patch, state.emission, state.reflectance
    state.received = yield from state.gather_in_steps(state.radiosity)
    unshot = np.zeros_like(state.radiosity)
    moment, area = tree.moment, tree.area
    _find_unshot(leaves, patch, emission, reflectance, state.radiosity, state.received, unshot)
    direction = unshot.copy()
    lengths: list[FloatArray] = []
    turns: list[FloatArray] = []
    before = np.zeros(state.channels)
    for step in range(MOST_STEPS + 1):
        energy = np.zeros(state.channels)
        held, left, scale, unsent = _measure(
            leaves, patch, area, moment, emission, reflectance, state.radiosity, unshot, energy
        )  # fmt: skip
        if step:
            turns.append(_ratio(energy, before))
            _turn(turns[-1], unshot, direction)
        yield unsent / max(held, 1e-300)
        if np.sqrt(left) <= target * np.sqrt(scale):
            state.loss = min(state.loss, _least_loss(lengths, turns))
            loss = max(state.loss, 1.0 - float(reflectance.max(initial=0.0))) if amplified else 1.0
            if np.sqrt(left) <= target * np.sqrt(scale) * min(1.0, loss / ORDINARY_LOSS):
                return True
        if step == MOST_STEPS:
            break
        arrived = yield from state.gather_in_steps(direction)
        yield None
        curvature = np.zeros(state.channels)
        _weigh(leaves, patch, area, moment, reflectance, direction, arrived, curvature)
        if np.any((curvature <= 0.0) & (energy > 0.0)):
            return False
        lengths.append(_ratio(energy, curvature))
        before = energy
        _advance(
            lengths[-1], leaves, patch, reflectance, direction, arrived, state.radiosity, state.received,
            unshot,
        )  # fmt: skip
    return False


def _least_loss(lengths: list[FloatArray], turns: list[FloatArray]) -> float:
    """The least eigenvalue of Lanczos's matrix over the steps so far, of the channel where it is least."""
    least = 1.0
    for length, share in zip(np.transpose(lengths), np.transpose(turns), strict=True):
        n = int(np.argmin(length > 0.0)) if np.any(length <= 0.0) else len(length)
        if n == 0:
            continue
        inverse = 1.0 / length[:n]
        matrix = np.diag(inverse)
        matrix[np.arange(1, n), np.arange(1, n)] += share[: n - 1] * inverse[: n - 1]
        beside = np.sqrt(share[: n - 1]) * inverse[: n - 1]
        matrix[np.arange(1, n), np.arange(n - 1)] = beside
        least = min(least, float(np.linalg.eigvalsh(matrix)[0]))
    return least


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    return np.where(below > 0.0, above / np.where(below > 0.0, below, 1.0), 0.0)


@kernel
def _find_unshot(
    leaves: IntArray,
    patch: IntArray,
    emission: Spectra,
    reflectance: Spectra,
    radiosity: FloatArray,
    received: FloatArray,
    unshot: FloatArray,
) -> None:
    """What a gather would add to each leaf; leaves that reflect nothing hold what they emit."""
    for e in leaves:
        p = patch[e]
        for c in range(radiosity.shape[2]):
            if reflectance[p, c] > 0.0:
                unshot[e, 0, c] = emission[p, c] + reflectance[p, c] * received[e, 0, c] - radiosity[e, 0, c]
                for k in range(1, 3):
                    unshot[e, k, c] = reflectance[p, c] * received[e, k, c] - radiosity[e, k, c]
            else:
                radiosity[e, 0, c] = emission[p, c]
                radiosity[e, 1, c] = 0.0
                radiosity[e, 2, c] = 0.0


@kernel
def _advance(
    length: FloatArray,
    leaves: IntArray,
    patch: IntArray,
    reflectance: Spectra,
    direction: FloatArray,
    arrived: FloatArray,
    radiosity: FloatArray,
    received: FloatArray,
    unshot: FloatArray,
) -> None:
    """Go `length` (channels,) along `direction`, of which elements receive `arrived`."""
    for e in range(len(received)):
        for k in range(3):
            for c in range(len(length)):
                received[e, k, c] += length[c] * arrived[e, k, c]
    for e in leaves:
        for c in range(len(length)):
            rho = reflectance[patch[e], c]
            if rho > 0.0:
                for k in range(3):
                    step = direction[e, k, c]
                    radiosity[e, k, c] += length[c] * step
                    unshot[e, k, c] -= length[c] * (step - rho * arrived[e, k, c])


@kernel
def _turn(share: FloatArray, unshot: FloatArray, direction: FloatArray) -> None:
    for e in range(len(unshot)):
        for k in range(3):
            for c in range(len(share)):
                direction[e, k, c] = unshot[e, k, c] + share[c] * direction[e, k, c]


@kernel
def _product(moment: FloatArray, a: FloatArray, b: FloatArray, e: int, c: int) -> float:
    """Mean over an element of the product of two linear functions."""
    along = moment[e, 0] * b[e, 1, c] + moment[e, 1] * b[e, 2, c]
    across = moment[e, 1] * b[e, 1, c] + moment[e, 2] * b[e, 2, c]
    product: float = a[e, 0, c] * b[e, 0, c] + a[e, 1, c] * along + a[e, 2, c] * across
    return product


@kernel
def _weigh(
    leaves: IntArray,
    patch: IntArray,
    area: FloatArray,
    moment: FloatArray,
    reflectance: Spectra,
    direction: FloatArray,
    arrived: FloatArray,
    total: FloatArray,
) -> None:
    """Add to `total` (channels,) the inner products of `direction` and of what (I - rho T) makes of it.

    Over the leaves, weighted by area over reflectance; elements receive `arrived` of it.
    """
    for e in leaves:
        for c in range(len(total)):
            rho = reflectance[patch[e], c]
            if rho > 0.0:
                square = _product(moment, direction, direction, e, c)
                total[c] += area[e] * (square / rho - _product(moment, direction, arrived, e, c))


@kernel
def _measure(
    leaves: IntArray,
    patch: IntArray,
    area: FloatArray,
    moment: FloatArray,
    emission: Spectra,
    reflectance: Spectra,
    radiosity: FloatArray,
    unshot: FloatArray,
    energy: FloatArray,
) -> tuple[float, float, float, float]:
    """W that are held; squares, times area, of what is unshot and of what is reflected; W that are unshot.

    Adds to `energy` (channels,) the squares of what is unshot, weighted by area over reflectance.
    """
    held = 0.0
    left = 0.0
    scale = 0.0
    unsent = 0.0
    for e in leaves:
        for c in range(radiosity.shape[2]):
            held += area[e] * abs(radiosity[e, 0, c])
            unsent += area[e] * abs(unshot[e, 0, c])
            unshot_square = area[e] * _product(moment, unshot, unshot, e, c)
            left += unshot_square
            rho = reflectance[patch[e], c]
            if rho > 0.0:
                energy[c] += unshot_square / rho
            emitted = emission[patch[e], c]
            reflected = radiosity[e, 0, c] - emitted
            square = _product(moment, radiosity, radiosity, e, c)
            scale += area[e] * (square - radiosity[e, 0, c] ** 2 + reflected * reflected)
    return held, left, scale, unsent
