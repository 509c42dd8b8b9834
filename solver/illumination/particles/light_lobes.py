"""Lobes of virtual lights and of what they shine on, as factors of the light that Lambert's would give.

A light's lobe is cos^(k - 1) about an axis: its normal for directional emission, the mirrored direction of
arrival for glossy reflection. A receiver's is (n + 2) / 2 cos^n about the direction in which it mirrors its
eye (Lafortune and Willems 1994): with both, the whole of f_r is in the lighting pass, as [K 4.2] has it.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from solver.kernels import inline_kernel
from solver.types import Float32Array

_MOST_SINE: Final = np.float32(1.0 - 2.0**-24)
"""Squared sines end below 1, whose logarithm has one."""


class Gloss(NamedTuple):
    """Lobes of n receivers about the directions in which they mirror their eyes."""

    axis: Float32Array
    """(3, n) unit"""
    exponent: Float32Array
    """(n,)"""


@inline_kernel
def shape(
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    lights: Float32Array,
    k: int,
    lobe: np.float32,
    gain: Float32Array,
) -> None:
    """Let a light shine by a power of the cosine, of which Lambert's is in `gain` (n,)."""
    for i in range(len(x)):
        if gain[i] > np.float32(0.0):
            gain[i] *= _lobe(
                x[i] - lights[0, k], y[i] - lights[1, k], z[i] - lights[2, k],
                lights[12, k], lights[13, k], lights[14, k], lobe - np.float32(1.0),
            )  # fmt: skip


@inline_kernel
def _lobe(
    dx: np.float32,
    dy: np.float32,
    dz: np.float32,
    ax: np.float32,
    ay: np.float32,
    az: np.float32,
    exponent: np.float32,
) -> np.float32:
    """That power of the cosine between a vector and a unit axis; 0 beyond a right angle."""
    along = ax * dx + ay * dy + az * dz
    if along <= np.float32(0.0):
        return np.float32(0.0)
    square = dx * dx + dy * dy + dz * dz
    # By the sine: near the axis a cosine has few digits left, and a narrow lobe needs them.
    sx, sy, sz = ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx
    sine = min((sx * sx + sy * sy + sz * sz) / square, _MOST_SINE)
    lobe: np.float32 = np.exp(np.float32(0.5) * exponent * np.log1p(-sine))
    return lobe


@inline_kernel
def polish(
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    lights: Float32Array,
    k: int,
    gloss: Gloss,
    first: int,
    gain: Float32Array,
) -> None:
    """Let light at receivers (n,), which are those from `first` on, count by their lobes."""
    for i in range(len(x)):
        if gain[i] > np.float32(0.0):
            at = first + i
            exponent = gloss.exponent[at]
            gain[i] *= np.float32(0.5) * (exponent + np.float32(2.0)) * _lobe(
                lights[0, k] - x[i], lights[1, k] - y[i], lights[2, k] - z[i],
                gloss.axis[0, at], gloss.axis[1, at], gloss.axis[2, at], exponent,
            )  # fmt: skip
