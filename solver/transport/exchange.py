"""Exchange areas G12 = A1 F12 = A2 F21 between convex polygons, no occlusion.

Both polygons are first clipped by each other's plane ([H 4.2]: the part behind neither sends nor
receives; since areas, not fractions, are exchanged, the area correction is implicit). Then the method
follows from how close the pair is:

* separated: Lambert's formula averaged over n x n Gauss points of the smaller polygon ([H 4.2] method 3
  with deterministic points). The integrand is analytic up to the distance d of the polygons, so with
  x = d / h, h the half diagonal of the receiver, the error falls as rho^-2n, rho = x + sqrt(x^2 + 1):
  n is the smallest number that meets the tolerance;
* close: the double contour integral of `contour.py`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.geometry.clipping import clip_to_plane
from solver.geometry.distance import nearest_point
from solver.kernels import kernel
from solver.transport.contour import contour_exchange
from solver.transport.lambert import contour_sum, point_form_factor
from solver.types import FloatArray, Points

MAX_POINTS: Final = 4
"""Largest n of the n x n points; a pair that needs more is close."""

_RATE_CONSTANT: Final = 5.0
"""The error of n x n points is below this times rho^-2n in every tabled view factor."""

_RULES = [np.polynomial.legendre.leggauss(n) for n in range(1, MAX_POINTS + 2)]
GAUSS_NODES: Final[FloatArray] = np.array(
    [np.pad(0.5 * (x + 1.0), (0, MAX_POINTS + 1 - len(x))) for x, _ in _RULES]
)
GAUSS_WEIGHTS: Final[FloatArray] = np.array(
    [np.pad(0.5 * w, (0, MAX_POINTS + 1 - len(w))) for _, w in _RULES]
)


@kernel
def averaged_exchange(
    receiver: FloatArray,
    count: int,
    normal: FloatArray,
    area: float,
    n: int,
    source: FloatArray,
    source_count: int,
) -> float:
    """Lambert's formula averaged over n x n Gauss points of the receiver (4, 3), times its area.

    Both polygons lie wholly in front of each other. A triangle is the bilinear patch whose last two
    corners coincide; the Jacobian takes care of it.
    """
    nx = normal[0]
    ny = normal[1]
    nz = normal[2]
    if n == 1:
        cx = 0.0
        cy = 0.0
        cz = 0.0
        for k in range(count):
            cx += receiver[k, 0]
            cy += receiver[k, 1]
            cz += receiver[k, 2]
        return area * max(
            0.0, contour_sum(cx / count, cy / count, cz / count, nx, ny, nz, source, source_count)
        )
    if count == 3:
        n += 1
    total = 0.0
    weight_sum = 0.0
    for i in range(n):
        s = GAUSS_NODES[n - 1, i]
        for j in range(n):
            t = GAUSS_NODES[n - 1, j]
            # x(s, t) and its Jacobian on the bilinear patch.
            wa = (1.0 - s) * (1.0 - t)
            wb = s * (1.0 - t)
            wc = s * t
            wd = (1.0 - s) * t
            x = wa * receiver[0, 0] + wb * receiver[1, 0] + wc * receiver[2, 0] + wd * receiver[3, 0]
            y = wa * receiver[0, 1] + wb * receiver[1, 1] + wc * receiver[2, 1] + wd * receiver[3, 1]
            z = wa * receiver[0, 2] + wb * receiver[1, 2] + wc * receiver[2, 2] + wd * receiver[3, 2]
            sx = (1.0 - t) * (receiver[1, 0] - receiver[0, 0]) + t * (receiver[2, 0] - receiver[3, 0])
            sy = (1.0 - t) * (receiver[1, 1] - receiver[0, 1]) + t * (receiver[2, 1] - receiver[3, 1])
            sz = (1.0 - t) * (receiver[1, 2] - receiver[0, 2]) + t * (receiver[2, 2] - receiver[3, 2])
            tx = (1.0 - s) * (receiver[3, 0] - receiver[0, 0]) + s * (receiver[2, 0] - receiver[1, 0])
            ty = (1.0 - s) * (receiver[3, 1] - receiver[0, 1]) + s * (receiver[2, 1] - receiver[1, 1])
            tz = (1.0 - s) * (receiver[3, 2] - receiver[0, 2]) + s * (receiver[2, 2] - receiver[1, 2])
            jacobian = (sy * tz - sz * ty) * nx + (sz * tx - sx * tz) * ny + (sx * ty - sy * tx) * nz
            weight = GAUSS_WEIGHTS[n - 1, i] * GAUSS_WEIGHTS[n - 1, j] * jacobian
            total += weight * contour_sum(x, y, z, nx, ny, nz, source, source_count)
            weight_sum += weight
    return area * max(0.0, total / weight_sum)


@kernel
def points_needed(distance: float, half_diagonal: float, tolerance: float) -> int:
    """n of the n x n Gauss points that keep the relative error below `tolerance`; > MAX_POINTS: close."""
    if distance <= 0.0:
        return MAX_POINTS + 1
    x = distance / half_diagonal
    rho = x + math.sqrt(x * x + 1.0)
    return max(1, math.ceil(0.5 * math.log(_RATE_CONSTANT / tolerance) / math.log(rho)))


@kernel
def exchange_area(
    first: FloatArray,
    count1: int,
    normal1: FloatArray,
    area1: float,
    second: FloatArray,
    count2: int,
    normal2: FloatArray,
    area2: float,
    side_tolerance: float,
    tolerance: float,
    scratch: FloatArray,
) -> float:
    """Unoccluded exchange area in m2 of two planar convex polygons (4, 3), each seen from its front.

    `side_tolerance` in metres: how far a vertex may lie behind the other plane and count as on it;
    `tolerance`: relative error aimed at; scratch (2, 8, 3).
    """
    low2, high2 = heights(second, count2, first[0], normal1)
    if high2 <= side_tolerance:
        return 0.0
    low1, high1 = heights(first, count1, second[0], normal2)
    if high1 <= side_tolerance:
        return 0.0
    if low1 < -side_tolerance or low2 < -side_tolerance:
        kept2 = clip_to_plane(second, count2, normal1, dot3(normal1, first[0]), side_tolerance, scratch[1])
        kept1 = clip_to_plane(first, count1, normal2, dot3(normal2, second[0]), side_tolerance, scratch[0])
        return contour_exchange(scratch[0], kept1, scratch[1], kept2)
    if area1 <= area2:
        n = _receiver_points(first, count1, second, count2, normal2, tolerance, scratch[0, 0])
        if n <= MAX_POINTS:
            return averaged_exchange(first, count1, normal1, area1, n, second, count2)
    else:
        n = _receiver_points(second, count2, first, count1, normal1, tolerance, scratch[0, 0])
        if n <= MAX_POINTS:
            return averaged_exchange(second, count2, normal2, area2, n, first, count1)
    return contour_exchange(first, count1, second, count2)


@kernel
def dot3(a: FloatArray, b: FloatArray) -> float:
    """Inner product of two (3,) arrays."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@kernel
def heights(polygon: FloatArray, count: int, origin: FloatArray, normal: FloatArray) -> tuple[float, float]:
    """Lowest and highest signed distance of a polygon's vertices from the plane through `origin`."""
    lowest = math.inf
    highest = -math.inf
    for k in range(count):
        height = (
            normal[0] * (polygon[k, 0] - origin[0])
            + normal[1] * (polygon[k, 1] - origin[1])
            + normal[2] * (polygon[k, 2] - origin[2])
        )
        lowest = min(lowest, height)
        highest = max(highest, height)
    return lowest, highest


@kernel
def _receiver_points(
    receiver: FloatArray,
    count: int,
    source: FloatArray,
    source_count: int,
    source_normal: FloatArray,
    tolerance: float,
    nearest: FloatArray,
) -> int:
    cx = 0.0
    cy = 0.0
    cz = 0.0
    for k in range(count):
        cx += receiver[k, 0]
        cy += receiver[k, 1]
        cz += receiver[k, 2]
    cx /= count
    cy /= count
    cz /= count
    square = 0.0
    for k in range(count):
        dx = receiver[k, 0] - cx
        dy = receiver[k, 1] - cy
        dz = receiver[k, 2] - cz
        square = max(square, dx * dx + dy * dy + dz * dz)
    distance = math.sqrt(nearest_point(cx, cy, cz, source, source_count, source_normal, nearest))
    return points_needed(distance, math.sqrt(square), tolerance)


def form_factor(receiver: Points, source: Points, tolerance: float = 1e-4) -> float:
    """Form factor F from convex planar polygon `receiver` (n, 3) to `source`, no occlusion.

    The fraction of the light leaving the front of `receiver` that reaches the front of `source`;
    relative error about `tolerance` or less. Reciprocal: area x factor is symmetric to rounding of the
    method chosen. [H 4.2]
    """
    if len(receiver) > 4:
        pieces = _fan(receiver)
        areas = np.array([_prepared(piece)[3] for piece in pieces])
        return float(
            sum(form_factor(p, source, tolerance) * a for p, a in zip(pieces, areas, strict=True))
            / areas.sum()
        )
    if len(source) > 4:
        return sum(form_factor(receiver, piece, tolerance) for piece in _fan(source))
    p, n1, normal1, area1 = _prepared(receiver)
    q, n2, normal2, area2 = _prepared(source)
    size = float(np.linalg.norm(np.ptp(np.concatenate([p, q]), axis=0)))
    scratch = np.empty((2, 8, 3))
    return (
        exchange_area(p, n1, normal1, area1, q, n2, normal2, area2, 1e-12 * size, tolerance, scratch) / area1
    )


def _fan(polygon: Points) -> list[Points]:
    return [polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)]


def _prepared(polygon: Points) -> tuple[Points, int, FloatArray, float]:
    corners = np.ascontiguousarray(polygon if len(polygon) == 4 else polygon[[0, 1, 2, 2]], dtype=np.float64)
    doubled = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    if len(polygon) == 3:
        doubled = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    length = float(np.linalg.norm(doubled))
    return corners, len(polygon), doubled / length, 0.5 * length


__all__ = ["MAX_POINTS", "exchange_area", "form_factor", "point_form_factor", "points_needed"]
