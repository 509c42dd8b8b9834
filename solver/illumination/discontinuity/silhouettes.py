"""Silhouettes: which edges bound what their sheets hide, as seen from a point.

An edge bounds a shadow only if all sheets along it are seen on one side of it: else what one leaves free
another covers, as at an edge of a box that shows both its faces. Sides are told by geometry, not by which
way faces look, so that rooms that are turned inward, boxes and open sheets are all treated alike.
"""

from __future__ import annotations

import math

from solver.illumination.discontinuity.outlines import FLAT, Outlines
from solver.kernels import kernel
from solver.types import FloatArray


@kernel
def is_silhouette(outlines: Outlines, edge: int, x: float, y: float, z: float, tolerance: float) -> bool:
    """Whether an edge bounds what its sheets hide from the point (x, y, z): none of two lie on either side.

    A sheet within `tolerance` metres of a plane through the point is seen edge-on: it is on no side.
    """
    if outlines.is_flat[edge]:
        return False
    w = outlines.ends[edge, 0]
    left = False
    right = False
    for i in range(outlines.sheet_start[edge], outlines.sheet_start[edge + 1]):
        height = (
            outlines.sheet_normal[i, 0] * (x - outlines.point[w, 0])
            + outlines.sheet_normal[i, 1] * (y - outlines.point[w, 1])
            + outlines.sheet_normal[i, 2] * (z - outlines.point[w, 2])
        )
        if height > tolerance:
            left = True
        elif height < -tolerance:
            right = True
    return not (left and right)


@kernel
def silhouette_spans(
    outlines: Outlines,
    w: int,
    a: FloatArray,
    b: FloatArray,
    t0: float,
    t1: float,
    tolerance: float,
    spans: FloatArray,
) -> int:
    """Cut [t0, t1] of a source's edge from a to b where the planes of the sheets around w cross it.

    Between the cuts, ascending in spans, the same edges at w are silhouettes. Returns their number, ends
    included.
    """
    spans[0] = t0
    n = 1
    for i in range(outlines.spoke_start[w], outlines.spoke_start[w + 1]):
        e = outlines.spoke[i]
        if outlines.is_flat[e]:
            continue
        for j in range(outlines.sheet_start[e], outlines.sheet_start[e + 1]):
            h0 = 0.0
            h1 = 0.0
            for axis in range(3):
                h0 += outlines.sheet_normal[j, axis] * (a[axis] - outlines.point[w, axis])
                h1 += outlines.sheet_normal[j, axis] * (b[axis] - outlines.point[w, axis])
            if (h0 > tolerance and h1 < -tolerance) or (h0 < -tolerance and h1 > tolerance):
                t = h0 / (h0 - h1)
                if t > t0 and t < t1:
                    at = n
                    while at > 1 and spans[at - 1] > t:
                        spans[at] = spans[at - 1]
                        at -= 1
                    spans[at] = t
                    n += 1
    spans[n] = t1
    return n + 1


@kernel
def silhouette_rays(outlines: Outlines, w: int, x: FloatArray, tolerance: float, rays: FloatArray) -> int:
    """The edges (m, 3) at vertex w that are silhouettes from x (3,), as vectors from w; returns m.

    0 if two of them run straight on: then w casts nothing of its own.
    """
    m = 0
    for i in range(outlines.spoke_start[w], outlines.spoke_start[w + 1]):
        e = outlines.spoke[i]
        if not is_silhouette(outlines, e, x[0], x[1], x[2], tolerance):
            continue
        far = outlines.ends[e, 0] + outlines.ends[e, 1] - w
        for axis in range(3):
            rays[m, axis] = outlines.point[far, axis] - outlines.point[w, axis]
        m += 1
    if m == 2:
        length0 = 0.0
        length1 = 0.0
        for axis in range(3):
            length0 += rays[0, axis] ** 2
            length1 += rays[1, axis] ** 2
        bend = 0.0
        for axis in range(3):
            bend += (rays[0, axis] / math.sqrt(length0) + rays[1, axis] / math.sqrt(length1)) ** 2
        if bend <= FLAT * FLAT:
            return 0
    return m
