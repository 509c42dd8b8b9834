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

from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.meshing.topology import Topology
from solver.kernels import inline_kernel, kernel
from solver.parallel import core_count, run_chunks
from solver.transport.field import RadiosityField
from solver.types import BoolArray, FloatArray, IntArray

_CHUNK: Final = 2048
"""Leaves or vertices below which a second thread is not worth its while."""

_RANK: Final = 1e-9
"""Neighbours lie on one line if the fit's determinant is at most this times its squared trace."""


def vertex_irradiance(field: RadiosityField, surfaces: Surfaces, topology: Topology) -> FloatArray:
    """Irradiance at the vertices of `topology`, (v, 3) W/m2."""
    n, v = len(field.patch), len(topology.position)
    u_axis, v_axis = _axes(surfaces.normal)
    origin = surfaces.corners[:, 0]
    flat = np.empty((v, 2))
    centroid = np.empty((n, 2))
    means = np.ascontiguousarray(field.irradiance)
    gradient = np.zeros((n, 2, 3))
    spread = np.zeros((n, 3))
    values = np.empty((v, 3))
    t = topology
    on_border = np.zeros(v, dtype=np.bool_)
    leaf, slot = t.border >> 2, t.border & 3
    on_border[t.vertex[leaf, slot]] = True
    on_border[t.vertex[leaf, (slot + 1) % field.corner_count[leaf]]] = True

    def flatten(start: int, stop: int) -> None:
        _flatten(
            start, stop, t.vertex, field.corner_count, t.position, field.patch,
            origin, u_axis, v_axis, flat, centroid,
        )  # fmt: skip

    def fit(start: int, stop: int) -> None:
        _fit(
            start, stop, t.vertex, field.corner_count, t.inside_start, t.inside, t.leaf_start, t.leaf_edge,
            t.hanging_on, centroid, means, gradient, spread,
        )  # fmt: skip

    def evaluate(start: int, stop: int) -> None:
        _evaluate(
            start, stop, t.leaf_start, t.leaf_edge, t.hanging_on, on_border, flat, centroid, means,
            gradient, spread, values,
        )  # fmt: skip

    for work, count in ((flatten, n), (fit, n), (evaluate, v)):
        run_chunks(work, count, max(_CHUNK, -(-count // core_count())))
    return values


def _axes(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors (p, 3) each that span the planes of unit normals (p, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    u = np.cross(helper, normal)
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(normal, u)


@kernel
def _flatten(
    start: int,
    stop: int,
    vertex: IntArray,
    count: IntArray,
    position: FloatArray,
    patch: IntArray,
    origin: FloatArray,
    u_axis: FloatArray,
    v_axis: FloatArray,
    flat: FloatArray,
    centroid: FloatArray,
) -> None:
    """Coordinates of vertices and centroids of leaves in the planes of their patches."""
    for leaf in range(start, stop):
        p = patch[leaf]
        for k in range(count[leaf]):
            i = vertex[leaf, k]
            u = 0.0
            v = 0.0
            for axis in range(3):
                d = position[i, axis] - origin[p, axis]
                u += d * u_axis[p, axis]
                v += d * v_axis[p, axis]
            flat[i, 0] = u
            flat[i, 1] = v
        # The centroid is the mean of the centroids of two triangles, weighted by area.
        a = vertex[leaf, 0]
        total = 0.0
        centroid[leaf, 0] = 0.0
        centroid[leaf, 1] = 0.0
        for k in range(1, count[leaf] - 1):
            b = vertex[leaf, k]
            c = vertex[leaf, k + 1]
            doubled = (flat[b, 0] - flat[a, 0]) * (flat[c, 1] - flat[a, 1]) - (flat[b, 1] - flat[a, 1]) * (
                flat[c, 0] - flat[a, 0]
            )
            total += doubled
            for axis in range(2):
                centroid[leaf, axis] += doubled * (flat[a, axis] + flat[b, axis] + flat[c, axis]) / 3.0
        centroid[leaf, 0] /= total
        centroid[leaf, 1] /= total


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
    normal = np.empty(3)
    moment = np.empty((2, 3))
    for leaf in range(start, stop):
        normal[:] = 0.0
        moment[:] = 0.0
        for k in range(count[leaf]):
            # All vertices on the edge: its start, and those inside it.
            edge = 4 * leaf + k
            for i in range(inside_start[edge] - 1, inside_start[edge + 1]):
                v = vertex[leaf, k] if i < inside_start[edge] else inside[i]
                for j in range(leaf_start[v], leaf_start[v + 1]):
                    _add_neighbour(leaf, leaf_edge[j] >> 2, centroid, means, normal, moment, spread)
                if hanging_on[v] >= 0:
                    _add_neighbour(leaf, hanging_on[v], centroid, means, normal, moment, spread)
        trace = normal[0] + normal[2]
        if trace == 0.0:
            continue
        determinant = normal[0] * normal[2] - normal[1] * normal[1]
        for c in range(3):
            if determinant > _RANK * trace * trace:
                gradient[leaf, 0, c] = (normal[2] * moment[0, c] - normal[1] * moment[1, c]) / determinant
                gradient[leaf, 1, c] = (normal[0] * moment[1, c] - normal[1] * moment[0, c]) / determinant
            else:
                # All neighbours in one direction: nothing is known across it.
                gradient[leaf, 0, c] = moment[0, c] / trace
                gradient[leaf, 1, c] = moment[1, c] / trace


@inline_kernel
def _add_neighbour(
    leaf: int,
    other: int,
    centroid: FloatArray,
    means: FloatArray,
    normal: FloatArray,
    moment: FloatArray,
    spread: FloatArray,
) -> None:
    """Add one neighbour to the normal equations of a leaf's gradient."""
    if other == leaf:
        return
    du = centroid[other, 0] - centroid[leaf, 0]
    dv = centroid[other, 1] - centroid[leaf, 1]
    weight = 1.0 / (du * du + dv * dv)
    normal[0] += weight * du * du
    normal[1] += weight * du * dv
    normal[2] += weight * dv * dv
    for c in range(3):
        difference = means[other, c] - means[leaf, c]
        moment[0, c] += weight * du * difference
        moment[1, c] += weight * dv * difference
        spread[leaf, c] = max(spread[leaf, c], abs(difference))


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
    mean = np.empty(3)
    planes = np.empty(3)
    slope = np.empty((2, 3))
    low = np.empty(3)
    high = np.empty(3)
    reach = np.empty(3)
    for v in range(start, stop):
        mean[:] = 0.0
        planes[:] = 0.0
        slope[:] = 0.0
        low[:] = np.inf
        high[:] = 0.0
        reach[:] = 0.0
        total = 0.0
        at_u = 0.0
        at_v = 0.0
        last = leaf_start[v + 1] + (1 if hanging_on[v] >= 0 else 0)
        for j in range(leaf_start[v], last):
            leaf = leaf_edge[j] >> 2 if j < leaf_start[v + 1] else hanging_on[v]
            du = flat[v, 0] - centroid[leaf, 0]
            dv = flat[v, 1] - centroid[leaf, 1]
            weight = 1.0 / np.sqrt(du * du + dv * dv)
            total += weight
            at_u += weight * du
            at_v += weight * dv
            for c in range(3):
                value = means[leaf, c]
                low[c] = min(low[c], value)
                high[c] = max(high[c], value)
                reach[c] = max(reach[c], spread[leaf, c])
                mean[c] += weight * value
                slope[0, c] += weight * gradient[leaf, 0, c]
                slope[1, c] += weight * gradient[leaf, 1, c]
                planes[c] += weight * (value + gradient[leaf, 0, c] * du + gradient[leaf, 1, c] * dv)
        for c in range(3):
            carried = (slope[0, c] * at_u + slope[1, c] * at_v) / (total * total)
            carried = min(max(carried, -reach[c]), reach[c])
            p = mean[c] / total + carried
            value = (p + 2.0 * planes[c] / total) / 3.0
            if on_border[v]:
                low[c] = max(min(low[c], p), 0.0)
                high[c] = max(high[c], p)
            values[v, c] = min(max(value, low[c]), high[c])
