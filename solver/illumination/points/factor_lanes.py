"""Form factors of many elements at once, in lanes, so that the loops over them vectorise ([H eq. 6.1]).

Nothing but arithmetic: angles by a polynomial, choices by selection. What a point's horizon cuts is told and
left to others.
"""

from __future__ import annotations

import math
from typing import Final

from solver.kernels import inline_kernel, kernel
from solver.types import Corners, FloatArray

LANES: Final = 16
"""Elements side by side in a block."""

SOURCE_NORMAL: Final = 12 * LANES
FOURTH: Final = 15 * LANES
LOWEST: Final = 16 * LANES
HIGHEST: Final = 17 * LANES
FACTOR: Final = 18 * LANES
WEIGHT: Final = 19 * LANES
PLACE: Final = 20 * LANES
BLOCK: Final = 23 * LANES
"""Rows of a block, LANES numbers each: coordinates of four corners relative to the point (a triangle repeats
its last), the element's normal, 1 if it has a fourth corner and else 0; then what is found: heights of lowest
and highest corner over the horizon, form factor, weight of the places whence its light comes, and their sums
times weight."""

INWARDS: Final = 1.0 / math.sqrt(3.0)
"""Where between middle and corner the places lie that stand for an element: exact for quadratics."""

_EIGHTH: Final = math.sqrt(2.0) - 1.0
"""Tangent of an eighth of a half turn."""


@inline_kernel
def angle_of(y: float, x: float) -> float:
    """atan2(y, x) for y >= 0, to 3 units in the last place; NaN where both are 0.

    The polynomial is atan(s) / s in powers of s^2 up to s = _EIGHTH, by interpolation at Chebyshev's nodes.
    """
    flat = abs(x)
    small = y if y < flat else flat
    great = flat if y < flat else y
    beyond = small > _EIGHTH * great
    above = small - great if beyond else small
    below = small + great if beyond else great
    s = above / below
    z = s * s
    p = -0.017801728127587804
    p = p * z + 0.037961811576853154
    p = p * z - 0.05034963565667152
    p = p * z + 0.05846846929215768
    p = p * z - 0.06662947468404955
    p = p * z + 0.07692044951515743
    p = p * z - 0.0909089678847213
    p = p * z + 0.11111110744267384
    p = p * z - 0.14285714279240191
    p = p * z + 0.1999999999994087
    p = p * z - 0.3333333333333312
    angle = s + s * (z * p)
    angle = angle + 0.25 * math.pi if beyond else angle
    angle = 0.5 * math.pi - angle if y > flat else angle
    return math.pi - angle if x < 0.0 else angle


@kernel
def fill_lane(
    block: FloatArray,
    lane: int,
    x: FloatArray,
    corners: Corners,
    polygon: int,
    count: int,
    normals: FloatArray,
    plane: int,
) -> None:
    """Put a row of corners (n, 4, 3) with a row of unit normals (p, 3) into a lane of a block (BLOCK,)."""
    at = lane
    for corner in range(4):
        for axis in range(3):
            block[at] = corners[polygon, corner, axis] - x[axis]
            at += LANES
    for axis in range(3):
        block[at] = normals[plane, axis]
        at += LANES
    block[at] = 1.0 if count == 4 else 0.0


@kernel
def polygon_of_lane(block: FloatArray, lane: int, count: int, polygons: FloatArray, slot: int) -> None:
    """Copy the corners in a lane, relative to the point, to a row of polygons (s, >= count, 3)."""
    at = lane
    for corner in range(count):
        for axis in range(3):
            polygons[slot, corner, axis] = block[at]
            at += LANES


@kernel
def find_factors(block: FloatArray, nx: float, ny: float, nz: float) -> None:
    """Fill in what is found of all lanes, from a point with unit normal n; factors are not clipped.

    A factor holds where the lowest corner is not below the horizon and the point is before the element.
    """
    for k in range(LANES):
        block[LOWEST + k] = math.inf
        block[HIGHEST + k] = -math.inf
        block[FACTOR + k] = 0.0
    for corner in range(4):
        a = 3 * corner * LANES
        b = 3 * ((corner + 1) % 4) * LANES
        for k in range(LANES):
            ax = block[a + k]
            ay = block[a + LANES + k]
            az = block[a + 2 * LANES + k]
            bx = block[b + k]
            by = block[b + LANES + k]
            bz = block[b + 2 * LANES + k]
            ex = bx - ax
            ey = by - ay
            ez = bz - az
            cx = ay * ez - az * ey
            cy = az * ex - ax * ez
            cz = ax * ey - ay * ex
            length = math.sqrt(cx * cx + cy * cy + cz * cz)
            angle = angle_of(length, ax * bx + ay * by + az * bz)
            height = nx * ax + ny * ay + nz * az
            across = nx * cx + ny * cy + nz * cz
            term = angle * across / (length if length > 0.0 else 1.0)
            block[FACTOR + k] -= term * (0.5 / math.pi) if length > 0.0 else 0.0
            block[LOWEST + k] = height if height < block[LOWEST + k] else block[LOWEST + k]
            block[HIGHEST + k] = height if height > block[HIGHEST + k] else block[HIGHEST + k]
    _find_places(block, nx, ny, nz)


@kernel
def _find_places(block: FloatArray, nx: float, ny: float, nz: float) -> None:
    """Weigh the places between middle and corners of all lanes by how much light from there counts."""
    for k in range(LANES):
        block[WEIGHT + k] = 0.0
        block[PLACE + k] = 0.0
        block[PLACE + LANES + k] = 0.0
        block[PLACE + 2 * LANES + k] = 0.0
    for corner in range(4):
        a = 3 * corner * LANES
        for k in range(LANES):
            fourth = block[FOURTH + k]
            part = (1.0 - INWARDS) / (3.0 + fourth)
            mx = block[k] + block[3 * LANES + k] + block[6 * LANES + k] + fourth * block[9 * LANES + k]
            my = (
                block[LANES + k]
                + block[4 * LANES + k]
                + block[7 * LANES + k]
                + fourth * block[10 * LANES + k]
            )
            mz = (
                block[2 * LANES + k]
                + block[5 * LANES + k]
                + block[8 * LANES + k]
                + fourth * block[11 * LANES + k]
            )
            px = part * mx + INWARDS * block[a + k]
            py = part * my + INWARDS * block[a + LANES + k]
            pz = part * mz + INWARDS * block[a + 2 * LANES + k]
            here = nx * px + ny * py + nz * pz
            there = -(
                block[SOURCE_NORMAL + k] * px
                + block[SOURCE_NORMAL + LANES + k] * py
                + block[SOURCE_NORMAL + 2 * LANES + k] * pz
            )
            square = px * px + py * py + pz * pz
            counts = here > 0.0 and there > 0.0
            weight = here * there / (square * square if counts else 1.0)
            weight = (weight if counts else 0.0) * (1.0 if corner < 3 else fourth)
            block[WEIGHT + k] += weight
            block[PLACE + k] += weight * px
            block[PLACE + LANES + k] += weight * py
            block[PLACE + 2 * LANES + k] += weight * pz
