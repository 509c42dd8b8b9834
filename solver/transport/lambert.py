"""Point-to-polygon form factors by Lambert's contour formula, with horizon clipping.

Source: [H] Hardt 1996, eq. 6.1 and section 6.2.1. Each edge's vector Gamma is taken from r x e, with e
the edge itself, instead of r_k x r_k+1: the cross product of nearly parallel vectors would lose the
digits of a small or distant polygon.
"""

from __future__ import annotations

import math

import numpy as np

from solver.kernels import kernel
from solver.types import FloatArray, Points


@kernel
def contour_sum(
    px: float, py: float, pz: float, nx: float, ny: float, nz: float, polygon: FloatArray, count: int
) -> float:
    """Form factor from a point to a polygon wholly above its horizon; negative for a polygon's back."""
    total = 0.0
    ax = polygon[count - 1, 0] - px
    ay = polygon[count - 1, 1] - py
    az = polygon[count - 1, 2] - pz
    for k in range(count):
        bx = polygon[k, 0] - px
        by = polygon[k, 1] - py
        bz = polygon[k, 2] - pz
        ex = bx - ax
        ey = by - ay
        ez = bz - az
        cx = ay * ez - az * ey
        cy = az * ex - ax * ez
        cz = ax * ey - ay * ex
        length = math.sqrt(cx * cx + cy * cy + cz * cz)
        if length > 0.0:
            angle = math.atan2(length, ax * bx + ay * by + az * bz)
            total += angle * (nx * cx + ny * cy + nz * cz) / length
        ax = bx
        ay = by
        az = bz
    return -total / (2.0 * math.pi)


@kernel
def point_form_factor(
    px: float,
    py: float,
    pz: float,
    nx: float,
    ny: float,
    nz: float,
    polygon: FloatArray,
    count: int,
    scratch: FloatArray,
) -> float:
    """Form factor from a point with unit normal n to the front of a convex polygon, horizon clipped.

    polygon (>= count, 3) counter-clockwise from its front; scratch (>= count + 1, 3). 0 where the
    point is behind the polygon. [H 6.1, 6.2.1]
    """
    lowest = math.inf
    highest = -math.inf
    for k in range(count):
        height = nx * (polygon[k, 0] - px) + ny * (polygon[k, 1] - py) + nz * (polygon[k, 2] - pz)
        lowest = min(lowest, height)
        highest = max(highest, height)
    if highest <= 0.0:
        return 0.0
    if lowest >= 0.0:
        return max(0.0, contour_sum(px, py, pz, nx, ny, nz, polygon, count))
    kept = 0
    last = count - 1
    height_a = nx * (polygon[last, 0] - px) + ny * (polygon[last, 1] - py) + nz * (polygon[last, 2] - pz)
    for k in range(count):
        height_b = nx * (polygon[k, 0] - px) + ny * (polygon[k, 1] - py) + nz * (polygon[k, 2] - pz)
        if (height_a > 0.0 and height_b < 0.0) or (height_a < 0.0 and height_b > 0.0):
            t = height_a / (height_a - height_b)
            for axis in range(3):
                scratch[kept, axis] = polygon[last, axis] + t * (polygon[k, axis] - polygon[last, axis])
            kept += 1
        if height_b >= 0.0:
            for axis in range(3):
                scratch[kept, axis] = polygon[k, axis]
            kept += 1
        last = k
        height_a = height_b
    return max(0.0, contour_sum(px, py, pz, nx, ny, nz, scratch, kept))


@kernel
def _points_to_polygon(
    points: FloatArray, normals: FloatArray, polygon: FloatArray, count: int, out: FloatArray
) -> None:
    scratch = np.empty((count + 1, 3))
    for i in range(len(points)):
        out[i] = point_form_factor(
            points[i, 0],
            points[i, 1],
            points[i, 2],
            normals[i, 0],
            normals[i, 1],
            normals[i, 2],
            polygon,
            count,
            scratch,
        )


def points_to_polygon(points: Points, normals: FloatArray, polygon: Points) -> FloatArray:
    """(n,) form factors from points (n, 3) with unit normals (n, 3) to the front of a convex polygon (m, 3).

    No occlusion. Relative error below 1e-12 unless the factor itself is a difference of nearly equal
    angles (a polygon seen edge-on). [H eq. 6.1]
    """
    out = np.empty(len(points))
    _points_to_polygon(points, normals, polygon, len(polygon), out)
    return out
