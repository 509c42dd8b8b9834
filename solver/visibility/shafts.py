"""Shafts: which polygons can stand between two elements ([H 4.1], without its test of all triples).

The shaft of a pair is the convex hull of its two polygons. It is bounded by their two planes and by the
planes through an edge of one and a vertex of the other that have both polygons on one side. A polygon
outside any of these planes, or with both elements on one side of its own plane, cannot block. What
remains are the pair's blockers: none means full visibility, exactly. Children of a link inherit its
blockers and test only those; the first lists come from a walk of the bounding volume hierarchy.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver import tolerances
from solver.kernels import kernel
from solver.types import FloatArray

MAX_PLANES: Final = 20
"""Two polygon planes, and at most one supporting plane on either side of each of eight edges."""

FULL: Final = 0
PARTIAL: Final = 1
NONE: Final = 2
"""Visibility classes of a link."""


_IN_LINE: Final = 1e-7
"""An edge and a vertex span a plane if the sine of the angle at which they are seen is more than this."""


@kernel
def shaft_planes(
    first: FloatArray,
    n1: int,
    normal1: FloatArray,
    second: FloatArray,
    n2: int,
    normal2: FloatArray,
    planes: FloatArray,
) -> int:
    """Bounding planes (a, b, c, d) of the hull of two polygons (4, 3), inside where ax + by + cz >= d.

    planes (MAX_PLANES, 4) is filled; returns how many there are. Normals are of unit length.
    """
    count = 0
    for which in range(2):
        polygon = first if which == 0 else second
        normal = normal1 if which == 0 else normal2
        for axis in range(3):
            planes[count, axis] = normal[axis]
        planes[count, 3] = normal[0] * polygon[0, 0] + normal[1] * polygon[0, 1] + normal[2] * polygon[0, 2]
        count += 1
    for which in range(2):
        a = first if which == 0 else second
        na = n1 if which == 0 else n2
        b = second if which == 0 else first
        nb = n2 if which == 0 else n1
        for k in range(na):
            m = (k + 1) % na
            ex = a[m, 0] - a[k, 0]
            ey = a[m, 1] - a[k, 1]
            ez = a[m, 2] - a[k, 2]
            edge = np.sqrt(ex * ex + ey * ey + ez * ez)
            for v in range(nb):
                rx = b[v, 0] - a[k, 0]
                ry = b[v, 1] - a[k, 1]
                rz = b[v, 2] - a[k, 2]
                px = ey * rz - ez * ry
                py = ez * rx - ex * rz
                pz = ex * ry - ey * rx
                length = np.sqrt(px * px + py * py + pz * pz)
                reach = np.sqrt(rx * rx + ry * ry + rz * rz)
                if length <= _IN_LINE * edge * reach:
                    continue
                px /= length
                py /= length
                pz /= length
                d = px * a[k, 0] + py * a[k, 1] + pz * a[k, 2]
                slack = tolerances.SIDE * (edge + reach)
                low = 0.0
                high = 0.0
                for j in range(na):
                    h = px * a[j, 0] + py * a[j, 1] + pz * a[j, 2] - d
                    low = min(low, h)
                    high = max(high, h)
                if low < -slack and high > slack:
                    break
                for j in range(nb):
                    h = px * b[j, 0] + py * b[j, 1] + pz * b[j, 2] - d
                    low = min(low, h)
                    high = max(high, h)
                    if low < -slack and high > slack:
                        break
                if count < MAX_PLANES and not (low < -slack and high > slack):
                    sign = 1.0 if high > -low else -1.0
                    planes[count, 0] = sign * px
                    planes[count, 1] = sign * py
                    planes[count, 2] = sign * pz
                    planes[count, 3] = sign * d
                    count += 1
                    break
    return count


@kernel
def covers(
    blocker: FloatArray,
    n: int,
    normal: FloatArray,
    first: FloatArray,
    n1: int,
    second: FloatArray,
    n2: int,
    tolerance: float,
) -> bool:
    """Whether one convex polygon (4, 3) hides the elements from each other entirely.

    True if the elements lie on different sides of its plane and every segment between their vertices
    passes through it: where those segments meet the plane, their hull holds all others.
    """
    offset = normal[0] * blocker[0, 0] + normal[1] * blocker[0, 1] + normal[2] * blocker[0, 2]
    for i in range(n1):
        a = normal[0] * first[i, 0] + normal[1] * first[i, 1] + normal[2] * first[i, 2] - offset
        if abs(a) <= tolerance:
            return False
        for j in range(n2):
            b = normal[0] * second[j, 0] + normal[1] * second[j, 1] + normal[2] * second[j, 2] - offset
            if abs(b) <= tolerance or (a > 0.0) == (b > 0.0):
                return False
            t = a / (a - b)
            x = first[i, 0] + t * (second[j, 0] - first[i, 0])
            y = first[i, 1] + t * (second[j, 1] - first[i, 1])
            z = first[i, 2] + t * (second[j, 2] - first[i, 2])
            for k in range(n):
                m = (k + 1) % n
                ex = blocker[m, 0] - blocker[k, 0]
                ey = blocker[m, 1] - blocker[k, 1]
                ez = blocker[m, 2] - blocker[k, 2]
                rx = x - blocker[k, 0]
                ry = y - blocker[k, 1]
                rz = z - blocker[k, 2]
                side = (
                    (ey * rz - ez * ry) * normal[0]
                    + (ez * rx - ex * rz) * normal[1]
                    + (ex * ry - ey * rx) * normal[2]
                )
                if side < 0.0:
                    return False
    return True
