"""Points of elements for visibility rays: by area, or by the solid angle under which an element is seen.

Pairs far apart are sampled by area on both ends. The kernel cos cos / (pi r^2) of close pairs is peaked,
without bound where they touch; from a point of the smaller end the larger is then sampled by solid angle
(Arvo 1995, "Stratified sampling of spherical triangles"), which leaves a weight of at most 2 times the
area.
"""

from __future__ import annotations

import math

import numpy as np

from solver.kernels import kernel
from solver.types import FloatArray


@kernel
def fraction_of(x: float) -> float:
    """x less the integer below it; far sooner done than x % 1."""
    return x - math.floor(x)


@kernel
def hash_index(x: np.int64) -> np.int64:
    """63 bits that look random, from a number of a pair of elements."""
    h = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x7F4A7C15)
    h ^= h >> np.uint64(32)
    h *= np.uint64(0xD6E8FEB86659FD93)
    h ^= h >> np.uint64(32)
    h *= np.uint64(0xD6E8FEB86659FD93)
    h ^= h >> np.uint64(32)
    return np.int64(h >> np.uint64(1))


@kernel
def sample_element(
    corners: FloatArray, count: int, normal: FloatArray, area: float, u: float, v: float, out: FloatArray
) -> float:
    """Point of an element (4, 3) at (u, v) in the unit square, into out (3,); returns its area weight.

    The weight is the Jacobian of the map: over the unit square its mean is the element's area.
    """
    if count == 3:
        r = math.sqrt(u)
        a = 1.0 - r
        b = r * (1.0 - v)
        c = r * v
        for axis in range(3):
            out[axis] = a * corners[0, axis] + b * corners[1, axis] + c * corners[2, axis]
        return area
    sx = (1.0 - v) * (corners[1, 0] - corners[0, 0]) + v * (corners[2, 0] - corners[3, 0])
    sy = (1.0 - v) * (corners[1, 1] - corners[0, 1]) + v * (corners[2, 1] - corners[3, 1])
    sz = (1.0 - v) * (corners[1, 2] - corners[0, 2]) + v * (corners[2, 2] - corners[3, 2])
    tx = (1.0 - u) * (corners[3, 0] - corners[0, 0]) + u * (corners[2, 0] - corners[1, 0])
    ty = (1.0 - u) * (corners[3, 1] - corners[0, 1]) + u * (corners[2, 1] - corners[1, 1])
    tz = (1.0 - u) * (corners[3, 2] - corners[0, 2]) + u * (corners[2, 2] - corners[1, 2])
    wa = (1.0 - u) * (1.0 - v)
    wb = u * (1.0 - v)
    wc = u * v
    wd = (1.0 - u) * v
    for axis in range(3):
        out[axis] = (
            wa * corners[0, axis] + wb * corners[1, axis] + wc * corners[2, axis] + wd * corners[3, axis]
        )
    nx, ny, nz = sy * tz - sz * ty, sz * tx - sx * tz, sx * ty - sy * tx
    jacobian: float = nx * normal[0] + ny * normal[1] + nz * normal[2]
    return jacobian


@kernel
def _solid_angle(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    """Solid angle of the spherical triangle of unit vectors (van Oosterom and Strackee 1983)."""
    triple = (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    bc = b[0] * c[0] + b[1] * c[1] + b[2] * c[2]
    ca = c[0] * a[0] + c[1] * a[1] + c[2] * a[2]
    return 2.0 * math.atan2(abs(triple), 1.0 + ab + bc + ca)


@kernel
def _towards(a: FloatArray, b: FloatArray, out: FloatArray) -> float:
    """The unit vector orthogonal to unit a in the half plane of b, into out; returns a . b."""
    dot: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    square = 0.0
    for axis in range(3):
        out[axis] = b[axis] - dot * a[axis]
        square += out[axis] * out[axis]
    scale = 1.0 / math.sqrt(square) if square > 0.0 else 0.0
    for axis in range(3):
        out[axis] *= scale
    return float(dot)


@kernel
def _direction_in(
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    area: float,
    u: float,
    v: float,
    work: FloatArray,
    out: FloatArray,
) -> None:
    """Direction at (u, v) of the unit square in a spherical triangle, uniform by solid angle; work (3, 3)."""
    to_b = work[0]
    to_c = work[1]
    third = work[2]
    cos_ab = _towards(a, b, to_b)
    _towards(a, c, to_c)
    cos_alpha = min(1.0, max(-1.0, to_b[0] * to_c[0] + to_b[1] * to_c[1] + to_b[2] * to_c[2]))
    sin_alpha = math.sqrt(1.0 - cos_alpha * cos_alpha)
    # The vertex on the arc a-c that cuts off the share u of the solid angle.
    angle = u * area - math.acos(cos_alpha)
    s = math.sin(angle)
    t = math.cos(angle)
    f = t - cos_alpha
    g = s + sin_alpha * cos_ab
    below = (g * s + f * t) * sin_alpha
    q = ((g * t - f * s) * cos_alpha - g) / below if below != 0.0 else 1.0
    q = min(1.0, max(-1.0, q))
    r = math.sqrt(1.0 - q * q)
    for axis in range(3):
        third[axis] = q * a[axis] + r * to_c[axis]
    # The point on the arc from b to it.
    dot = _towards(b, third, to_b)
    z = 1.0 - v * (1.0 - dot)
    r = math.sqrt(max(0.0, 1.0 - z * z))
    for axis in range(3):
        out[axis] = z * b[axis] + r * to_b[axis]


@kernel
def sample_by_solid_angle(
    corners: FloatArray,
    count: int,
    normal: FloatArray,
    x: FloatArray,
    u: float,
    v: float,
    work: FloatArray,
    out: FloatArray,
) -> float:
    """Point at (u, v) of the unit square of an element (4, 3) as seen from x, into out (3,).

    Returns the solid angle of the element, 0 where x does not see its front or out is none of its
    points. work is (8, 3).
    """
    height = 0.0
    for axis in range(3):
        height += (x[axis] - corners[0, axis]) * normal[axis]
    if height <= 0.0:
        return 0.0
    for k in range(count):
        square = 0.0
        for axis in range(3):
            work[k, axis] = corners[k, axis] - x[axis]
            square += work[k, axis] * work[k, axis]
        if square == 0.0:
            return 0.0
        scale = 1.0 / math.sqrt(square)
        for axis in range(3):
            work[k, axis] *= scale
    # One of the two triangles by its share, whose remainder is u again.
    area = _solid_angle(work[0], work[1], work[2])
    total = area
    second = 2
    if count == 4:
        other = _solid_angle(work[0], work[2], work[3])
        total += other
        if u * total >= area and other > 0.0:
            u = (u * total - area) / other
            area = other
            second = 3
        elif area > 0.0:
            u = u * total / area
    if area <= 0.0:
        return 0.0
    _direction_in(work[0], work[second - 1], work[second], area, min(u, 1.0), v, work[4:7], work[7])
    fall = work[7, 0] * normal[0] + work[7, 1] * normal[1] + work[7, 2] * normal[2]
    if fall >= 0.0:
        return 0.0
    for axis in range(3):
        out[axis] = x[axis] - height / fall * work[7, axis]
    return total
