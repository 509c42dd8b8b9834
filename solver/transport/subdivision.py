"""How elements split, and where their parts lie.

A quadrilateral or triangle splits into four at its edge midpoints; a quadrilateral at least twice as long
as wide splits into two across its length, so that slivers do not breed slivers. Midpoints are computed
alike from either side of an edge: vertices that neighbours share are bit-identical.
"""

from __future__ import annotations

import math

import numpy as np

from solver.kernels import kernel
from solver.types import Corners, FloatArray, Int64Array, IntArray, Points
from solver.visibility.sampling import hash_index


@kernel
def _edge_squares(corners: FloatArray) -> tuple[float, float]:
    """Squared mean lengths of a quadrilateral's two pairs of opposite sides."""
    u = 0.0
    v = 0.0
    for axis in range(3):
        u += (corners[1, axis] - corners[0, axis] + corners[2, axis] - corners[3, axis]) ** 2
        v += (corners[3, axis] - corners[0, axis] + corners[2, axis] - corners[1, axis]) ** 2
    return u, v


@kernel
def count_children(corners: Corners, corner_count: IntArray, ids: IntArray, counts: IntArray) -> None:
    """How many children (m,) the elements `ids` (m,) split into: 2 or 4."""
    for i in range(len(ids)):
        counts[i] = 4
        if corner_count[ids[i]] == 4:
            u, v = _edge_squares(corners[ids[i]])
            if u >= 4.0 * v or v >= 4.0 * u:
                counts[i] = 2


@kernel
def make_children(
    ids: IntArray,
    first: IntArray,
    counts: IntArray,
    corners: Corners,
    corner_count: IntArray,
    patch: IntArray,
    parent: IntArray,
    area: FloatArray,
) -> None:
    """Write the children of `ids` (m,), from `first` (m,) on."""
    middle = np.empty((4, 3))
    center = np.empty(3)
    for i in range(len(ids)):
        e = ids[i]
        n = corner_count[e]
        for k in range(n):
            for axis in range(3):
                middle[k, axis] = 0.5 * (corners[e, k, axis] + corners[e, (k + 1) % n, axis])
        f = first[i]
        if n == 3:
            for k in range(3):
                for axis in range(3):
                    corners[f + k, 0, axis] = corners[e, k, axis]
                    corners[f + k, 1, axis] = middle[k, axis]
                    corners[f + k, 2, axis] = middle[(k + 2) % 3, axis]
                    corners[f + 3, k, axis] = middle[k, axis]
            for k in range(4):
                for axis in range(3):
                    corners[f + k, 3, axis] = corners[f + k, 2, axis]
        elif counts[i] == 4:
            for axis in range(3):
                center[axis] = 0.5 * (
                    0.5 * (corners[e, 0, axis] + corners[e, 1, axis])
                    + 0.5 * (corners[e, 2, axis] + corners[e, 3, axis])
                )
            for k in range(4):
                for axis in range(3):
                    corners[f + k, k, axis] = corners[e, k, axis]
                    corners[f + k, (k + 1) % 4, axis] = middle[k, axis]
                    corners[f + k, (k + 2) % 4, axis] = center[axis]
                    corners[f + k, (k + 3) % 4, axis] = middle[(k + 3) % 4, axis]
        else:
            u, v = _edge_squares(corners[e])
            along = 0 if u >= v else 1
            # Cut sides `along` and `along + 2` at their middles.
            a = along
            b = (along + 1) % 4
            c = (along + 2) % 4
            d = (along + 3) % 4
            for axis in range(3):
                corners[f, a, axis] = corners[e, a, axis]
                corners[f, b, axis] = middle[a, axis]
                corners[f, c, axis] = middle[c, axis]
                corners[f, d, axis] = corners[e, d, axis]
                corners[f + 1, a, axis] = middle[a, axis]
                corners[f + 1, b, axis] = corners[e, b, axis]
                corners[f + 1, c, axis] = corners[e, c, axis]
                corners[f + 1, d, axis] = middle[c, axis]
        total = 0.0
        for k in range(counts[i]):
            c = f + k
            corner_count[c] = n
            patch[c] = patch[e]
            parent[c] = e
            area[c] = polygon_area(corners[c])
            total += area[c]
        # The children's areas sum to the parent's to the last digit that matters to energy.
        for k in range(counts[i]):
            area[f + k] *= area[e] / total


@kernel
def polygon_area(corners: FloatArray) -> float:
    """Area of a planar convex quadrilateral (4, 3), or of a triangle that repeats its last corner."""
    ax = corners[2, 0] - corners[0, 0]
    ay = corners[2, 1] - corners[0, 1]
    az = corners[2, 2] - corners[0, 2]
    bx = corners[3, 0] - corners[1, 0]
    by = corners[3, 1] - corners[1, 1]
    bz = corners[3, 2] - corners[1, 2]
    cx = ay * bz - az * by
    cy = az * bx - ax * bz
    cz = ax * by - ay * bx
    return 0.5 * math.sqrt(cx * cx + cy * cy + cz * cz)


@kernel
def place_elements(
    corners: Corners,
    corner_count: IntArray,
    patch: IntArray,
    parent: IntArray,
    axes: FloatArray,
    start: int,
    centroid: Points,
    moment: FloatArray,
    offset: FloatArray,
) -> None:
    """Centroids (n, 3), second moments (n, 3) and offsets (n, 2) of the elements from `start` on."""
    x = np.empty((4, 2))
    for e in range(start, len(corners)):
        u = axes[patch[e], 0]
        v = axes[patch[e], 1]
        n = corner_count[e]
        for k in range(n):
            x[k, :] = 0.0
            for axis in range(3):
                d = corners[e, k, axis] - corners[e, 0, axis]
                x[k, 0] += d * u[axis]
                x[k, 1] += d * v[axis]
        # One or two triangles; a triangle with corners a, b, c at mean m has the second moments
        # (a a + b b + c c + 9 m m) / 12.
        weight = 0.0
        cu = cv = uu = uv = vv = 0.0
        for k in range(1, n - 1):
            w = x[k, 0] * x[k + 1, 1] - x[k, 1] * x[k + 1, 0]
            mu = (x[k, 0] + x[k + 1, 0]) / 3.0
            mv = (x[k, 1] + x[k + 1, 1]) / 3.0
            weight += w
            cu += w * mu
            cv += w * mv
            uu += w * (x[k, 0] ** 2 + x[k + 1, 0] ** 2 + 9.0 * mu * mu) / 12.0
            uv += w * (x[k, 0] * x[k, 1] + x[k + 1, 0] * x[k + 1, 1] + 9.0 * mu * mv) / 12.0
            vv += w * (x[k, 1] ** 2 + x[k + 1, 1] ** 2 + 9.0 * mv * mv) / 12.0
        cu /= weight
        cv /= weight
        moment[e, 0] = uu / weight - cu * cu
        moment[e, 1] = uv / weight - cu * cv
        moment[e, 2] = vv / weight - cv * cv
        for axis in range(3):
            centroid[e, axis] = corners[e, 0, axis] + cu * u[axis] + cv * v[axis]
        offset[e, :] = 0.0
        if parent[e] >= 0:
            for axis in range(3):
                d = centroid[e, axis] - centroid[parent[e], axis]
                offset[e, 0] += d * u[axis]
                offset[e, 1] += d * v[axis]


@kernel
def place_keys(centroid: Points) -> Int64Array:
    """Numbers (n,) that are the same for elements with the same `centroid` (n, 3), bit by bit."""
    keys = np.empty(len(centroid), dtype=np.int64)
    bits = centroid.view(np.int64)
    for e in range(len(centroid)):
        key = np.int64(0)
        for axis in range(3):
            key = hash_index(key + bits[e, axis])
        keys[e] = key
    return keys
