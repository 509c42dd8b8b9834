"""Exchange areas of close pairs by the double contour integral, the inner one in closed form.

    A1 F12 = 1/(2 pi)  oint oint  ln |x1 - x2|  dx1 . dx2

This is [H 4.2]'s method 1 made cheap and stable. Averaging Lambert's formula over points of the
receiver (method 3) converges slowly for pairs that touch or nearly do, where the integrand is
singular; the contour integrand is only logarithmic there. Along an edge of the second polygon the
integral is elementary. Along the first it is taken by Gauss's rule on pieces that end where an end of
the other edge is closest, with nodes crowded towards the ends of each piece, where the remaining
x ln x lies. The formula loses digits with the square of distance over size, so that distant pairs must
not use it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.types import FloatArray

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(12)
_T = 0.5 * (_GAUSS_X + 1.0)
# The grading t -> t^3 (10 - 15 t + 6 t^2) sends the uniform parameter to one crowded at both ends.
NODES: Final[FloatArray] = np.ascontiguousarray(_T**3 * (10.0 - 15.0 * _T + 6.0 * _T**2))
WEIGHTS: Final[FloatArray] = np.ascontiguousarray(0.5 * _GAUSS_W * 30.0 * _T**2 * (1.0 - _T) ** 2)


@kernel
def _log_antiderivative(s: float, height2: float, height: float) -> float:
    """Antiderivative in s of ln sqrt(s^2 + height^2)."""
    square = s * s + height2
    if square <= 0.0:
        return 0.0
    value = 0.5 * s * math.log(square) - s
    if height > 0.0:
        value += height * math.atan(s / height)
    return value


@kernel
def contour_exchange(first: FloatArray, n1: int, second: FloatArray, n2: int) -> float:
    """A1 F12 in m2 of two convex polygons, each wholly in front of the other; polygons (>= n, 3)."""
    total = 0.0
    cuts = np.empty(4)
    for i in range(n1):
        j = (i + 1) % n1
        ax = first[i, 0]
        ay = first[i, 1]
        az = first[i, 2]
        ux = first[j, 0] - ax
        uy = first[j, 1] - ay
        uz = first[j, 2] - az
        length1 = math.sqrt(ux * ux + uy * uy + uz * uz)
        if length1 == 0.0:
            continue
        ux /= length1
        uy /= length1
        uz /= length1
        for k in range(n2):
            m = (k + 1) % n2
            vx = second[m, 0] - second[k, 0]
            vy = second[m, 1] - second[k, 1]
            vz = second[m, 2] - second[k, 2]
            length2 = math.sqrt(vx * vx + vy * vy + vz * vz)
            if length2 == 0.0:
                continue
            vx /= length2
            vy /= length2
            vz /= length2
            cosine = ux * vx + uy * vy + uz * vz
            if cosine == 0.0:
                continue
            # The outer edge is cut where it passes closest to either end of the inner edge.
            wx = second[k, 0] - ax
            wy = second[k, 1] - ay
            wz = second[k, 2] - az
            near = min(max(wx * ux + wy * uy + wz * uz, 0.0), length1)
            far = (second[m, 0] - ax) * ux + (second[m, 1] - ay) * uy + (second[m, 2] - az) * uz
            far = min(max(far, 0.0), length1)
            cuts[0] = 0.0
            cuts[1] = min(near, far)
            cuts[2] = max(near, far)
            cuts[3] = length1
            inner = 0.0
            for piece in range(3):
                width = cuts[piece + 1] - cuts[piece]
                if width <= 1e-14 * length1:
                    continue
                for node in range(len(NODES)):
                    t = cuts[piece] + width * NODES[node]
                    # Components of (x1 - second[k]) along and across the inner edge.
                    rx = ax + t * ux - second[k, 0]
                    ry = ay + t * uy - second[k, 1]
                    rz = az + t * uz - second[k, 2]
                    along = rx * vx + ry * vy + rz * vz
                    cx = ry * vz - rz * vy
                    cy = rz * vx - rx * vz
                    cz = rx * vy - ry * vx
                    height2 = cx * cx + cy * cy + cz * cz
                    height = math.sqrt(height2)
                    value = _log_antiderivative(length2 - along, height2, height) - _log_antiderivative(
                        -along, height2, height
                    )
                    inner += width * WEIGHTS[node] * value
            total += cosine * inner
    return max(0.0, total / (2.0 * math.pi))
