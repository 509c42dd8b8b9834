"""Irradiance in the middles of the leaves that are drawn as fans."""

from __future__ import annotations

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.types import Corners, FloatArray, IntArray


@kernel
def fill_middles(
    corners: Corners,
    count: IntArray,
    vertex: IntArray,
    mean: FloatArray,
    values: FloatArray,
    middle: FloatArray,
) -> None:
    """Values in the middles of m leaves: what a quadratic with these corners and this mean has there.

    It is the (bi)linear interpolant of the corners there, plus what the mean differs from that of the
    interpolant, times 3/2 for a quadrilateral and 4/3 for a triangle; and it stays between corners and mean.
    """
    spanned = np.ones(4)
    weight = np.ones(4)
    for i in range(len(count)):
        n = count[i]
        # The mean of the bilinear interpolant weighs corners by the areas they span: a product of mass
        # matrix and corner Jacobians. A triangle's corners weigh the same.
        if n == 4:
            for k in range(4):
                spanned[k] = _spanned_area(corners, i, k)
            for k in range(4):
                weight[k] = 4.0 * spanned[k] + 2.0 * (spanned[k - 1] + spanned[k - 3]) + spanned[k - 2]
        else:
            weight[:] = 1.0
        total = 0.0
        for k in range(n):
            total += weight[k]
        for c in range(3):
            low = mean[i, c]
            high = mean[i, c]
            interpolated = 0.0
            plain = 0.0
            for k in range(n):
                value = values[vertex[i, k], c]
                low = min(low, value)
                high = max(high, value)
                interpolated += weight[k] / total * value
                plain += value / n
            bulge = (1.5 if n == 4 else 4.0 / 3.0) * (mean[i, c] - interpolated)
            middle[i, c] = min(max(plain + bulge, low), high)


@inline_kernel
def _spanned_area(corners: Corners, i: int, k: int) -> float:
    """Area of the parallelogram that the edges at corner k of a quadrilateral span."""
    ax = corners[i, (k + 1) % 4, 0] - corners[i, k, 0]
    ay = corners[i, (k + 1) % 4, 1] - corners[i, k, 1]
    az = corners[i, (k + 1) % 4, 2] - corners[i, k, 2]
    bx = corners[i, (k + 3) % 4, 0] - corners[i, k, 0]
    by = corners[i, (k + 3) % 4, 1] - corners[i, k, 1]
    bz = corners[i, (k + 3) % 4, 2] - corners[i, k, 2]
    cx = ay * bz - az * by
    cy = az * bx - ax * bz
    cz = ax * by - ay * bx
    return float(np.sqrt(cx * cx + cy * cy + cz * cz))
