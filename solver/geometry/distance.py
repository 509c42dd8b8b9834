"""The point of a polygon that is nearest to a given one."""

from __future__ import annotations

import math

from solver.kernels import kernel
from solver.types import FloatArray


@kernel
def nearest_point(
    x: float, y: float, z: float, polygon: FloatArray, count: int, normal: FloatArray, nearest: FloatArray
) -> float:
    """Squared distance (m2) of (x, y, z) from a planar convex polygon (>= count, 3) with unit normal (3,).

    Its nearest point is written to nearest (3,).
    """
    least = math.inf
    inside = True
    for k in range(count):
        m = (k + 1) % count
        ex = polygon[m, 0] - polygon[k, 0]
        ey = polygon[m, 1] - polygon[k, 1]
        ez = polygon[m, 2] - polygon[k, 2]
        px = x - polygon[k, 0]
        py = y - polygon[k, 1]
        pz = z - polygon[k, 2]
        left = (
            normal[0] * (ey * pz - ez * py)
            + normal[1] * (ez * px - ex * pz)
            + normal[2] * (ex * py - ey * px)
        )
        if left >= 0.0:
            continue
        inside = False
        along = (px * ex + py * ey + pz * ez) / (ex * ex + ey * ey + ez * ez)
        along = min(1.0, max(0.0, along))
        dx = px - along * ex
        dy = py - along * ey
        dz = pz - along * ez
        square = dx * dx + dy * dy + dz * dz
        if square < least:
            least = square
            nearest[0] = x - dx
            nearest[1] = y - dy
            nearest[2] = z - dz
    if inside:
        height = (
            (x - polygon[0, 0]) * normal[0]
            + (y - polygon[0, 1]) * normal[1]
            + (z - polygon[0, 2]) * normal[2]
        )
        nearest[0] = x - height * normal[0]
        nearest[1] = y - height * normal[1]
        nearest[2] = z - height * normal[2]
        return float(height * height)
    return least
