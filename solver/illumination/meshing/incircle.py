"""Whether a point lies within the circle through three others: the exact answer, for points of whole numbers.

The determinant is that of Shewchuk, Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric
Predicates, 1997, section 4.4. His filter tells most signs from float64; what it leaves open, points on a
circle above all, is reckoned in whole numbers of several digits to the base 2^24, which hold it all.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.types import Int64Array

BITS: Final = 44
"""Coordinates are at most 2^this."""

_DIGIT: Final = 24
_MASK: Final = (1 << _DIGIT) - 1

_DOUBT: Final = 2.0**-49
"""Rounding in the determinant, relative to its terms' sizes: (10 + 96 e) e, e = 2^-53, and more."""


@inline_kernel
def in_circle(xy: Int64Array, a: int, b: int, c: int, d: int) -> int:
    """1 if point d of xy (n, 2) is within the circle through a, b, c, which run counter-clockwise.

    0 if it is on the circle, -1 if outside.
    """
    ax, ay = xy[a, 0] - xy[d, 0], xy[a, 1] - xy[d, 1]
    bx, by = xy[b, 0] - xy[d, 0], xy[b, 1] - xy[d, 1]
    cx, cy = xy[c, 0] - xy[d, 0], xy[c, 1] - xy[d, 1]
    det, size = 0.0, 0.0
    for px, py, qx, qy, rx, ry in (
        (ax, ay, bx, by, cx, cy),
        (bx, by, cx, cy, ax, ay),
        (cx, cy, ax, ay, bx, by),
    ):
        lift = float(px) * float(px) + float(py) * float(py)
        left, right = float(qx) * float(ry), float(qy) * float(rx)
        det += lift * (left - right)
        size += lift * (abs(left) + abs(right))
    if det > _DOUBT * size:
        return 1
    if det < -_DOUBT * size:
        return -1
    return _exact_sign(ax, ay, bx, by, cx, cy)


@kernel
def _exact_sign(ax: int, ay: int, bx: int, by: int, cx: int, cy: int) -> int:
    total = np.zeros(8, np.int64)
    _add_term(total, ax, ay, bx, by, cx, cy)
    _add_term(total, bx, by, cx, cy, ax, ay)
    _add_term(total, cx, cy, ax, ay, bx, by)
    # All digits but the last become positive: it has the sign.
    rest = 0
    for i in range(7):
        total[i + 1] += total[i] >> _DIGIT
        rest |= total[i] & _MASK
    if total[7] != 0:
        return 1 if total[7] > 0 else -1
    return 1 if rest != 0 else 0


@inline_kernel
def _add_term(total: Int64Array, px: int, py: int, qx: int, qy: int, rx: int, ry: int) -> None:
    """Add (px^2 + py^2) (qx ry - qy rx), each factor as digits."""
    lift = _digits(px, px, py, py, 1)
    cross = _digits(qx, ry, qy, rx, -1)
    for i in range(4):
        for j in range(4):
            total[i + j] += lift[i] * cross[j]


@inline_kernel
def _digits(p: int, q: int, r: int, s: int, sign: int) -> tuple[int, int, int, int]:
    """The digits of p q + sign r s, lowest first; the last one has the sign."""
    p0, q0, r0, s0 = p & _MASK, q & _MASK, r & _MASK, s & _MASK
    p1, q1, r1, s1 = p >> _DIGIT, q >> _DIGIT, r >> _DIGIT, s >> _DIGIT
    low = p0 * q0 + sign * (r0 * s0)
    middle = p0 * q1 + p1 * q0 + sign * (r0 * s1 + r1 * s0) + (low >> _DIGIT)
    high = p1 * q1 + sign * (r1 * s1) + (middle >> _DIGIT)
    return low & _MASK, middle & _MASK, high & _MASK, high >> _DIGIT
