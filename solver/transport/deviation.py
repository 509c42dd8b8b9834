"""How much a form factor varies over its receiver: what subdividing the receiver would resolve ([H 4.4.1]).

Two estimates, of which the greater is taken. Over a receiver that the source overlooks as a whole, 4 (3)
Gauss points integrate quadratic functions exactly, so that the deviation is that of the form factor's
linear part; a distant source is taken as a point. Over a receiver much larger than its distance from the
source all points may miss the spot where the light falls: a point source at height h lights a footprint
of (integral F)^2 / integral F^2 = 3 pi h^2 of a parallel plane (6 pi h^2 of an orthogonal one), so that
the mean square of F is its squared mean times the ratio of area to footprint.
"""

from __future__ import annotations

import math
from typing import Final

from solver.kernels import kernel
from solver.transport.lambert import point_form_factor
from solver.types import FloatArray

_GAUSS: Final = 0.5 - 0.5 / math.sqrt(3.0)
_FOOTPRINT: Final = 3.0 * math.pi


@kernel
def form_factor_deviation(
    receiver: FloatArray,
    count: int,
    normal: FloatArray,
    area: float,
    source: FloatArray,
    source_count: int,
    source_normal: FloatArray,
    source_area: float,
    exchange: float,
    scratch: FloatArray,
) -> float:
    """RMS deviation over a receiver (4, 3) of the unoccluded form factor from its points to a source.

    exchange (m2) is the pair's exchange area; scratch is (8, 3).
    """
    cx = 0.0
    cy = 0.0
    cz = 0.0
    for k in range(source_count):
        cx += source[k, 0] / source_count
        cy += source[k, 1] / source_count
        cz += source[k, 2] / source_count
    sx = source[0, 0] - cx
    sy = source[0, 1] - cy
    sz = source[0, 2] - cz
    radius2 = sx * sx + sy * sy + sz * sz
    total = 0.0
    square_total = 0.0
    for k in range(count):
        # Each point is a blend of a corner and the centre of the receiver.
        if count == 4:
            m = (k + 1) % 4
            o = (k + 2) % 4
            n = (k + 3) % 4
            wk = (1.0 - _GAUSS) * (1.0 - _GAUSS)
            ws = _GAUSS * (1.0 - _GAUSS)
            wo = _GAUSS * _GAUSS
            x = wk * receiver[k, 0] + ws * (receiver[m, 0] + receiver[n, 0]) + wo * receiver[o, 0]
            y = wk * receiver[k, 1] + ws * (receiver[m, 1] + receiver[n, 1]) + wo * receiver[o, 1]
            z = wk * receiver[k, 2] + ws * (receiver[m, 2] + receiver[n, 2]) + wo * receiver[o, 2]
        else:
            m = (k + 1) % 3
            o = (k + 2) % 3
            x = (4.0 * receiver[k, 0] + receiver[m, 0] + receiver[o, 0]) / 6.0
            y = (4.0 * receiver[k, 1] + receiver[m, 1] + receiver[o, 1]) / 6.0
            z = (4.0 * receiver[k, 2] + receiver[m, 2] + receiver[o, 2]) / 6.0
        dx = cx - x
        dy = cy - y
        dz = cz - z
        square = dx * dx + dy * dy + dz * dz
        value = 0.0
        if square > 9.0 * radius2:
            cosine1 = dx * normal[0] + dy * normal[1] + dz * normal[2]
            cosine2 = -(dx * source_normal[0] + dy * source_normal[1] + dz * source_normal[2])
            if cosine1 > 0.0 and cosine2 > 0.0:
                value = cosine1 * cosine2 * source_area / (math.pi * square * square)
        else:
            value = point_form_factor(
                x, y, z, normal[0], normal[1], normal[2], source, source_count, scratch
            )
        total += value
        square_total += value * value
    mean = total / count
    variance = max(0.0, square_total / count - mean * mean)
    mean = exchange / area
    reach = _FOOTPRINT * max(_square_distance(cx, cy, cz, receiver, count, normal), 0.25 * radius2)
    if reach < area:
        variance = max(variance, mean * mean * (area / reach - 1.0))
    return math.sqrt(variance)


@kernel
def _square_distance(
    x: float, y: float, z: float, polygon: FloatArray, count: int, normal: FloatArray
) -> float:
    """Squared distance (m2) of a point from a convex polygon (4, 3)."""
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
            normal[0] * (ey * pz - ez * py) + normal[1] * (ez * px - ex * pz) + normal[2] * (ex * py - ey * px)
        )
        if left >= 0.0:
            continue
        inside = False
        along = (px * ex + py * ey + pz * ez) / (ex * ex + ey * ey + ez * ez)
        along = min(1.0, max(0.0, along))
        dx = px - along * ex
        dy = py - along * ey
        dz = pz - along * ez
        least = min(least, dx * dx + dy * dy + dz * dz)
    if inside:
        height = (
            (x - polygon[0, 0]) * normal[0] + (y - polygon[0, 1]) * normal[1] + (z - polygon[0, 2]) * normal[2]
        )
        return height * height
    return least
