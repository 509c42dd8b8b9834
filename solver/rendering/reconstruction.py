"""Irradiance at the corners of leaves, from the means over leaves.

Irradiance is what varies over a patch; its reflectance and emission do not, so B = E + rho H holds
exactly for what is rebuilt here. The steps, all in the plane of the patch:

1. each leaf gets the gradient that fits the means of the leaves around it best (least squares,
   weighted by inverse squared distance of centroids);
2. at each vertex, P is the weighted mean of the incident leaves' means, carried from their weighted
   centroid to the vertex by their mean gradient; G is the weighted mean of the incident leaves' planes
   at the vertex;
3. the value is (P + 2 G) / 3. On an even mesh that is the average of the four leaves with the
   curvature of the next ones taken out, (7 (a + b) - (z + c)) / 12 in one dimension: exact for cubics
   where a plain average is exact only for linear fields;
4. the value is kept within the means of the incident leaves, so that it does not swing beside a shadow
   edge. On the border of the patch P is always allowed, since it is what extrapolates a gradient to
   there, by no more than the leaves around differ. Nothing is negative.

P and G are exact for linear fields on any mesh, and so is the value.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.parallel import core_count, run_chunks
from solver.rendering.plane_points import CHUNK, PlanePoints
from solver.types import BoolArray, FloatArray, IntArray

_RANK: Final = 1e-9
"""Neighbours lie on one line if the fit's determinant is at most this times its squared trace."""


_NONE: Final = (0.0, 0.0, 0.0)

_Three: TypeAlias = tuple[float, float, float]
"""R, G and B. Sums over neighbours are these, which stay in registers, and not arrays, which do not."""


@inline_kernel
def _three(rows: FloatArray, k: int) -> _Three:
    return rows[k, 0], rows[k, 1], rows[k, 2]


@inline_kernel
def _plus(a: _Three, weight: float, b: _Three) -> _Three:
    return a[0] + weight * b[0], a[1] + weight * b[1], a[2] + weight * b[2]


@inline_kernel
def _lower(a: _Three, b: _Three) -> _Three:
    return min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])


@inline_kernel
def _most(a: _Three, b: _Three) -> _Three:
    """The greater of a and of the magnitude of b."""
    return max(a[0], abs(b[0])), max(a[1], abs(b[1])), max(a[2], abs(b[2]))


def vertex_irradiance(means: FloatArray, points: PlanePoints) -> FloatArray:
    """Irradiance (v, 3) at the vertices of leaves, from that over each leaf (n, 3), W/m2."""
    t = points.topology
    n, v = len(points.corner_count), len(t.position)
    means = np.ascontiguousarray(means)
    gradient = np.empty((n, 2, 3))
    spread = np.empty((n, 3))
    values = np.empty((v, 3))

    def fit(start: int, stop: int) -> None:
        _fit(
            start, stop, t.vertex, points.corner_count, t.inside_start, t.inside, t.leaf_start, t.leaf_edge,
            t.hanging_on, points.centroid, means, gradient, spread,
        )  # fmt: skip

    def evaluate(start: int, stop: int) -> None:
        _evaluate(
            start, stop, t.leaf_start, t.leaf_edge, t.hanging_on, points.on_border, points.vertex,
            points.centroid, means, gradient, spread, values,
        )  # fmt: skip

    for work, count in ((fit, n), (evaluate, v)):
        run_chunks(work, count, max(CHUNK, -(-count // core_count())))
    return values


@kernel
def _fit(
    start: int,
    stop: int,
    vertex: IntArray,
    count: IntArray,
    inside_start: IntArray,
    inside: IntArray,
    leaf_start: IntArray,
    leaf_edge: IntArray,
    hanging_on: IntArray,
    centroid: FloatArray,
    means: FloatArray,
    gradient: FloatArray,
    spread: FloatArray,
) -> None:
    """Gradients of leaves, and the largest difference of their means from those of leaves around."""
    for leaf in range(start, stop):
        centre_u, centre_v = centroid[leaf, 0], centroid[leaf, 1]
        mean = _three(means, leaf)
        # The normal matrix (uu, uv, vv) of the least squares, and its right sides.
        uu = uv = vv = 0.0
        along_u, along_v, most = _NONE, _NONE, _NONE
        for k in range(count[leaf]):
            # All vertices on the edge: its start, and those inside it.
            edge = 4 * leaf + k
            for i in range(inside_start[edge] - 1, inside_start[edge + 1]):
                v = vertex[leaf, k] if i < inside_start[edge] else inside[i]
                last = leaf_start[v + 1] + (1 if hanging_on[v] >= 0 else 0)
                for j in range(leaf_start[v], last):
                    other = leaf_edge[j] >> 2 if j < leaf_start[v + 1] else hanging_on[v]
                    if other == leaf:
                        continue
                    du = centroid[other, 0] - centre_u
                    dv = centroid[other, 1] - centre_v
                    weight = 1.0 / (du * du + dv * dv)
                    wu, wv = weight * du, weight * dv
                    uu += wu * du
                    uv += wu * dv
                    vv += wv * dv
                    difference = _plus(_three(means, other), -1.0, mean)
                    along_u = _plus(along_u, wu, difference)
                    along_v = _plus(along_v, wv, difference)
                    most = _most(most, difference)
        trace = uu + vv
        determinant = uu * vv - uv * uv
        for c in range(3):
            spread[leaf, c] = most[c]
            if trace == 0.0:
                gradient[leaf, 0, c] = 0.0
                gradient[leaf, 1, c] = 0.0
            elif determinant > _RANK * trace * trace:
                gradient[leaf, 0, c] = (vv * along_u[c] - uv * along_v[c]) / determinant
                gradient[leaf, 1, c] = (uu * along_v[c] - uv * along_u[c]) / determinant
            else:
                # All neighbours in one direction: nothing is known across it.
                gradient[leaf, 0, c] = along_u[c] / trace
                gradient[leaf, 1, c] = along_v[c] / trace


@kernel
def _evaluate(
    start: int,
    stop: int,
    leaf_start: IntArray,
    leaf_edge: IntArray,
    hanging_on: IntArray,
    on_border: BoolArray,
    flat: FloatArray,
    centroid: FloatArray,
    means: FloatArray,
    gradient: FloatArray,
    spread: FloatArray,
    values: FloatArray,
) -> None:
    """Values at vertices from the leaves around them: steps 2 to 4."""
    for v in range(start, stop):
        total = at_u = at_v = 0.0
        mean, planes, slope_u, slope_v = _NONE, _NONE, _NONE, _NONE
        low, high, reach = (np.inf, np.inf, np.inf), _NONE, _NONE
        last = leaf_start[v + 1] + (1 if hanging_on[v] >= 0 else 0)
        for j in range(leaf_start[v], last):
            leaf = leaf_edge[j] >> 2 if j < leaf_start[v + 1] else hanging_on[v]
            du = flat[v, 0] - centroid[leaf, 0]
            dv = flat[v, 1] - centroid[leaf, 1]
            weight = 1.0 / np.sqrt(du * du + dv * dv)
            total += weight
            at_u += weight * du
            at_v += weight * dv
            value = _three(means, leaf)
            low, high = _lower(low, value), _most(high, value)
            reach = _most(reach, _three(spread, leaf))
            mean = _plus(mean, weight, value)
            along_u, along_v = _three(gradient[:, 0], leaf), _three(gradient[:, 1], leaf)
            slope_u = _plus(slope_u, weight, along_u)
            slope_v = _plus(slope_v, weight, along_v)
            planes = _plus(planes, weight, _plus(_plus(value, du, along_u), dv, along_v))
        for c in range(3):
            carried = (slope_u[c] * at_u + slope_v[c] * at_v) / (total * total)
            carried = min(max(carried, -reach[c]), reach[c])
            p = mean[c] / total + carried
            least, greatest = low[c], high[c]
            if on_border[v]:
                least = max(min(least, p), 0.0)
                greatest = max(greatest, p)
            values[v, c] = min(max((p + 2.0 * planes[c] / total) / 3.0, least), greatest)
