"""How a form factor varies over its receiver: a linear function, and what is left of it ([H 4.4.1]).

Over a receiver that the source overlooks as a whole, 4 (3) Gauss points and the centre tell the mean
position of the light that arrives, which is the linear part, and the residual from it: the part that
only subdividing the receiver would resolve. A distant source is taken as a point.

Over a receiver much larger than its distance from the source all points may miss the spot where the
light falls. A point source at height h lights a footprint of (integral F)^2 / integral F^2 = 3 pi h^2
of a parallel plane (6 pi h^2 of an orthogonal one), so that the mean square of F is its squared mean
times the ratio of area to footprint, and the light arrives at the point nearest to the source.
"""

from __future__ import annotations

import math
from typing import Final

from solver.geometry.distance import nearest_point
from solver.kernels import kernel
from solver.transport.lambert import point_form_factor
from solver.types import FloatArray

_GAUSS: Final = 0.5 - 0.5 / math.sqrt(3.0)
_FOOTPRINT: Final = 3.0 * math.pi
_CURVATURE: Final = 0.8
"""Mean square of a s^2 + b t^2 from its mean, over the squared difference of Gauss points and centre."""
_QUADRATURE: Final = 0.1
"""The points' mean may differ from the exact one by this much of it without there being a step."""
_EXACT: Final = 0.005
"""The same where all points are in one and the same light, each told exactly."""
_LEAST: Final = 0.25
"""The quadratic part is taken to be at least this times the square of the linear part over the mean."""


@kernel
def solve_moment(moment: FloatArray, u: float, v: float) -> tuple[float, float]:
    """The 2-vector whose product with second moments (3,) uu, uv, vv is (u, v)."""
    determinant = moment[0] * moment[2] - moment[1] * moment[1]
    return (moment[2] * u - moment[1] * v) / determinant, (moment[0] * v - moment[1] * u) / determinant


@kernel
def form_factor_variation(
    receiver: FloatArray,
    count: int,
    normal: FloatArray,
    axes: FloatArray,
    centroid: FloatArray,
    moment: FloatArray,
    area: float,
    source: FloatArray,
    source_count: int,
    source_normal: FloatArray,
    source_area: float,
    source_centroid: FloatArray,
    exchange: float,
    scratch: FloatArray,
    position: FloatArray,
) -> float:
    """RMS residual, over a receiver (4, 3), of the unoccluded form factor to a source from a linear function.

    Writes the mean position of the light, in metres from the centroid by the axes (2, 3) of the
    receiver, to position (2,): the linear function is mean (1 + x . S^-1 position), S the second
    moments (3,). exchange (m2) is the pair's exchange area; scratch is (8, 3).
    """
    radius2 = 0.0
    for k in range(source_count):
        square = 0.0
        for axis in range(3):
            square += (source[k, axis] - source_centroid[axis]) ** 2
        radius2 = max(radius2, square)
    # Form factors at the Gauss points, blends of a corner and its opposite, and at the centroid.
    u = axes[0]
    v = axes[1]
    value0 = value1 = value2 = value3 = 0.0
    middle = 0.0
    total = 0.0
    mean_u = 0.0
    mean_v = 0.0
    weight = 1.0
    exact = 0
    for k in range(count + 1):
        if k == count:
            x = centroid[0]
            y = centroid[1]
            z = centroid[2]
        elif count == 4:
            m = (k + 1) % 4
            o = (k + 2) % 4
            n = (k + 3) % 4
            wk = (1.0 - _GAUSS) * (1.0 - _GAUSS)
            ws = _GAUSS * (1.0 - _GAUSS)
            wo = _GAUSS * _GAUSS
            x = wk * receiver[k, 0] + ws * (receiver[m, 0] + receiver[n, 0]) + wo * receiver[o, 0]
            y = wk * receiver[k, 1] + ws * (receiver[m, 1] + receiver[n, 1]) + wo * receiver[o, 1]
            z = wk * receiver[k, 2] + ws * (receiver[m, 2] + receiver[n, 2]) + wo * receiver[o, 2]
            weight = (1.0 - 2.0 * _GAUSS) * _corner_jacobian(receiver, k, m, n, normal) / area + 2.0 * _GAUSS
        else:
            m = (k + 1) % 3
            o = (k + 2) % 3
            x = (4.0 * receiver[k, 0] + receiver[m, 0] + receiver[o, 0]) / 6.0
            y = (4.0 * receiver[k, 1] + receiver[m, 1] + receiver[o, 1]) / 6.0
            z = (4.0 * receiver[k, 2] + receiver[m, 2] + receiver[o, 2]) / 6.0
        dx = source_centroid[0] - x
        dy = source_centroid[1] - y
        dz = source_centroid[2] - z
        square = dx * dx + dy * dy + dz * dz
        cosine1 = dx * normal[0] + dy * normal[1] + dz * normal[2]
        cosine2 = -(dx * source_normal[0] + dy * source_normal[1] + dz * source_normal[2])
        value = 0.0
        if square > 9.0 * radius2 and cosine1 > 0.0 and cosine1 * cosine1 > radius2:
            # Far away, and wholly above the horizon.
            if cosine2 > 0.0:
                value = cosine1 * cosine2 * source_area / (math.pi * square * square)
        else:
            exact += 1
            value = point_form_factor(x, y, z, normal[0], normal[1], normal[2], source, source_count, scratch)
        if k == count:
            middle = value
            continue
        total += weight * value
        x -= centroid[0]
        y -= centroid[1]
        z -= centroid[2]
        mean_u += weight * value * (x * u[0] + y * u[1] + z * u[2])
        mean_v += weight * value * (x * v[0] + y * v[1] + z * v[2])
        if k == 0:
            value0 = value
        elif k == 1:
            value1 = value
        elif k == 2:
            value2 = value
        else:
            value3 = value
    mean = exchange / area
    square_mean = mean * mean
    residual = square_mean
    linear = 0.0
    if total > 0.0:
        mean_u /= total
        mean_v /= total
        a, b = solve_moment(moment, mean_u, mean_v)
        linear = square_mean * (a * mean_u + b * mean_v)
        scale = count / total
        twist = 0.25 * (value0 - value1 + value2 - value3) * scale if count == 4 else 0.0
        bend = 1.0 - middle * scale
        residual = square_mean * (twist * twist + _CURVATURE * bend * bend)
        # An edge of the light that the points do not show moves the mean, and leaves a step behind.
        allowed = _QUADRATURE * mean
        if exact == count + 1:
            apart = max(abs(value0 - middle), abs(value1 - middle), abs(value2 - middle))
            if count == 4:
                apart = max(apart, abs(value3 - middle))
            allowed = min(allowed, _EXACT * mean + apart)
        missed = abs(total / count - mean) - allowed
        if missed > 0.0:
            residual = max(residual, missed * max(mean, total / count))
    # The spot that the points may have missed.
    distance = nearest_point(
        source_centroid[0], source_centroid[1], source_centroid[2], receiver, count, normal, scratch[0]
    )
    reach = _FOOTPRINT * max(distance, 0.25 * radius2)
    spot = square_mean * (area / reach - 1.0)
    # The centre may have been in it, alone.
    residual = min(residual, max(spot, square_mean))
    if spot > residual + linear:
        mean_u = 0.0
        mean_v = 0.0
        for axis in range(3):
            d = scratch[0, axis] - centroid[axis]
            mean_u += d * u[axis]
            mean_v += d * v[axis]
        a, b = solve_moment(moment, mean_u, mean_v)
        linear = square_mean * (a * mean_u + b * mean_v)
        # No linear function of unit mean that is nowhere negative has more than this.
        most = square_mean
        if linear > most:
            shrink = math.sqrt(most / linear)
            mean_u *= shrink
            mean_v *= shrink
            linear = most
        residual = max(residual, spot - linear)
    position[0] = mean_u
    position[1] = mean_v
    return math.sqrt(max(residual, (_LEAST * linear / mean) ** 2 if mean > 0.0 else 0.0))


@kernel
def _corner_jacobian(polygon: FloatArray, k: int, m: int, n: int, normal: FloatArray) -> float:
    """Twice the area (m2) that corner k spans with its neighbours m and n.

    The Jacobian of a planar bilinear patch at that corner; linear over the patch, with the area as mean.
    """
    ax = polygon[m, 0] - polygon[k, 0]
    ay = polygon[m, 1] - polygon[k, 1]
    az = polygon[m, 2] - polygon[k, 2]
    bx = polygon[n, 0] - polygon[k, 0]
    by = polygon[n, 1] - polygon[k, 1]
    bz = polygon[n, 2] - polygon[k, 2]
    return float(
        (ay * bz - az * by) * normal[0] + (az * bx - ax * bz) * normal[1] + (ax * by - ay * bx) * normal[2]
    )
