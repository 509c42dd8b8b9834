"""Irradiance at points: the gather over the hierarchical solution, each element at the level it deserves.

From every patch a point descends as far as the radiosity residual, times the point's form factor, is
felt; a form factor is Lambert's contour formula over the part above the point's horizon [H eq. 6.1].
Occlusion is sampled: every element gets rays in proportion to the light it could bring, distributed by
the cosine-weighted solid angle under which it is seen, and the radiosity counts where it is seen.
Where nothing is in the way the result is exact for the solution as it stands.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.transport.lambert import point_form_factor
from solver.transport.oracle import element_residuals
from solver.transport.pushpull import pull
from solver.transport.state import TransportState
from solver.types import BoolArray, Corners, Float32Array, FloatArray, Int64Array, IntArray, Points
from solver.visibility.fraction import STRATIFIED
from solver.visibility.rays import RayScene
from solver.visibility.sampling import hash_index, sample_by_solid_angle, sample_element

RAYS_AT_ONCE: Final = 1 << 18
LEVEL: Final = 1e-3
"""An element is entered while its radiosity residual brings more than this share of the irradiance."""

_NEAR: Final = 16.0
_MISSED: Final = 0.2
# The R2 sequence.
_ROOT: Final = 1.3247179572447460
_DEPTH: Final = 256


def irradiance_at(
    state: TransportState, rays: RayScene, positions: Points, normals: FloatArray, rays_per_point: int
) -> tuple[FloatArray, FloatArray]:
    """Irradiance at points (n, 3) with unit normals (n, 3).

    Returns irradiance (n, channels) in W/m2 and the standard error of its luminance (n,).
    `rays_per_point` are shared by what a point may see, and every element gets at least one.
    """
    tree = state.tree
    functions, spread = _functions(state)
    size = tree.moment[:, 0] + tree.moment[:, 2]
    luminance = np.maximum(functions[:, 0] @ state.weights, 0.0)
    n = len(positions)
    result, error = np.zeros((n, state.channels)), np.zeros(n)
    batch = max(1, RAYS_AT_ONCE // (2 * rays_per_point))
    for first in range(0, n, batch):
        x, normal = positions[first : first + batch], normals[first : first + batch]
        total, count = np.zeros(len(x)), np.zeros(len(x), dtype=np.int64)
        nothing, empty = np.empty(0), np.empty(0, dtype=np.int32)

        def collect(
            start: int, stop: int, write: bool, slot: Int64Array, element: IntArray, factor: FloatArray,
            x: Points = x, normal: FloatArray = normal, total: FloatArray = total,
        ) -> None:  # fmt: skip
            _collect(
                x, normal, tree.patch_count, tree.child, tree.child_count, tree.corners, tree.corner_count,
                luminance, spread, write, start, stop, total, slot, element, factor,
            )  # fmt: skip

        run_chunks(lambda a, b: collect(a, b, False, count, empty, nothing), len(x), 16)  # noqa: B023
        slot = np.cumsum(count) - count
        entries = int(count.sum())
        element, factor = np.empty(entries, dtype=np.int32), np.empty(entries)
        run_chunks(lambda a, b: collect(a, b, True, slot, element, factor), len(x), 16)  # noqa: B023
        point = np.repeat(np.arange(len(x)), count)
        share = factor * luminance[element] / np.maximum(total[point], 1e-300)
        samples = 1 + (share * rays_per_point).astype(np.int64)
        ray = np.cumsum(samples) - samples
        everything = int(samples.sum())
        origins, directions = np.empty((2, everything, 3), dtype=np.float32)
        weights, seen = np.empty(everything), np.empty((everything, state.channels))

        def generate(
            start: int, stop: int, x: Points = x, normal: FloatArray = normal, point: Int64Array = point,
            element: IntArray = element, samples: Int64Array = samples, ray: Int64Array = ray,
            origins: Float32Array = origins, directions: Float32Array = directions,
            weights: FloatArray = weights, seen: FloatArray = seen,
        ) -> None:  # fmt: skip
            _generate(
                x, normal, point, element, samples, ray, tree.corners, tree.corner_count, tree.area,
                tree.patch, tree.patch_normal, tree.axes, tree.centroid, size, functions, rays.center,
                rays.scale, rays.offset, start, stop, origins, directions, weights, seen,
            )  # fmt: skip

        run_chunks(generate, entries, 512)
        blocked = rays.occluded_local(origins, directions)
        variance = np.zeros(len(x))
        _reduce(
            point, factor, samples, ray, weights, seen, state.weights, blocked,
            result[first : first + batch], variance,
        )  # fmt: skip
        error[first : first + batch] = np.sqrt(variance)
    return result, error


def _functions(state: TransportState) -> tuple[FloatArray, FloatArray]:
    """Radiosity functions (n, 3, channels) of all elements, inner ones too, and their residuals (n,)."""
    tree = state.tree
    moments = np.empty_like(state.radiosity)
    pull(tree.child, tree.child_count, tree.area, tree.moment, tree.offset, state.radiosity, moments)
    spread = np.empty(len(tree))
    element_residuals(
        tree.child, tree.child_count, tree.area, tree.moment, tree.offset, moments @ state.weights,
        np.zeros(len(tree)), spread,
    )  # fmt: skip
    uu, uv, vv = (tree.moment[:, k, None] for k in range(3))
    determinant = uu * vv - uv * uv
    functions = moments.copy()
    functions[:, 1] = (vv * moments[:, 1] - uv * moments[:, 2]) / determinant
    functions[:, 2] = (uu * moments[:, 2] - uv * moments[:, 1]) / determinant
    return functions, spread


@kernel
def _collect(
    positions: Points,
    normals: FloatArray,
    patches: int,
    child: IntArray,
    child_count: IntArray,
    corners: Corners,
    counts: IntArray,
    luminance: FloatArray,
    spread: FloatArray,
    write: bool,
    start: int,
    stop: int,
    total: FloatArray,
    slot: Int64Array,
    element: IntArray,
    factor: FloatArray,
) -> None:
    """Count, or write from slot[point] on, the elements each point gathers from, and their form factors.

    Counting also sums up what they would bring unoccluded, total (points,).
    """
    scratch = np.empty((8, 3))
    stack = np.empty(_DEPTH, dtype=np.int32)
    for point in range(start, stop):
        x = positions[point, 0]
        y = positions[point, 1]
        z = positions[point, 2]
        nx = normals[point, 0]
        ny = normals[point, 1]
        nz = normals[point, 2]
        if not write:
            for e in range(patches):
                if luminance[e] > 0.0:
                    total[point] += luminance[e] * point_form_factor(
                        x, y, z, nx, ny, nz, corners[e], counts[e], scratch
                    )
        limit = LEVEL * total[point]
        found = 0
        for root in range(patches):
            stack[0] = root
            depth = 1
            while depth > 0:
                depth -= 1
                e = stack[depth]
                if luminance[e] <= 0.0:
                    continue
                f = point_form_factor(x, y, z, nx, ny, nz, corners[e], counts[e], scratch)
                if f <= 0.0:
                    continue
                if child[e] >= 0 and f * spread[e] > limit and depth + child_count[e] <= _DEPTH:
                    for k in range(child[e], child[e] + child_count[e]):
                        stack[depth] = k
                        depth += 1
                    continue
                if write:
                    element[slot[point] + found] = e
                    factor[slot[point] + found] = f
                found += 1
        if not write:
            slot[point] = found


@kernel
def _generate(
    positions: Points,
    normals: FloatArray,
    point: Int64Array,
    element: IntArray,
    samples: Int64Array,
    first: Int64Array,
    corners: Corners,
    counts: IntArray,
    area: FloatArray,
    patch: IntArray,
    patch_normals: FloatArray,
    axes: FloatArray,
    centroid: Points,
    size: FloatArray,
    functions: FloatArray,
    center: FloatArray,
    scale: float,
    offset: float,
    start: int,
    stop: int,
    origins: Float32Array,
    directions: Float32Array,
    weights: FloatArray,
    seen: FloatArray,
) -> None:
    """Rays of the entries [start, stop), their weights, and the radiosities (rays, channels) they would see."""
    y = np.empty(3)
    work = np.empty((8, 3))
    for entry in range(start, stop):
        x = positions[point[entry]]
        n1 = normals[point[entry]]
        e = element[entry]
        n2 = patch_normals[patch[e]]
        square = 0.0
        for axis in range(3):
            square += (centroid[e, axis] - x[axis]) ** 2
        near = square < _NEAR * size[e]
        h = hash_index(np.int64(point[entry]) * np.int64(1000003) + np.int64(e))
        shift_u = (h & 0xFFFFF) / 1048576.0
        shift_v = ((h >> 20) & 0xFFFFF) / 1048576.0
        for s in range(samples[entry]):
            u = (shift_u + (s + 1) / _ROOT) % 1.0
            v = (shift_v + (s + 1) / (_ROOT * _ROOT)) % 1.0
            if near:
                weight = sample_by_solid_angle(corners[e], counts[e], n2, x, u, v, work, y)
            else:
                weight = sample_element(corners[e], counts[e], n2, area[e], u, v, y)
            square = 0.0
            cosine1 = 0.0
            cosine2 = 0.0
            for axis in range(3):
                d = y[axis] - x[axis]
                square += d * d
                cosine1 += d * n1[axis]
                cosine2 -= d * n2[axis]
            ray = first[entry] + s
            if weight > 0.0 and square > 0.0 and cosine1 > 0.0 and cosine2 > 0.0:
                weight *= cosine1 / math.sqrt(square) if near else cosine1 * cosine2 / (square * square)
                along = 0.0
                across = 0.0
                for axis in range(3):
                    d = y[axis] - centroid[e, axis]
                    along += d * axes[patch[e], 0, axis]
                    across += d * axes[patch[e], 1, axis]
                    a = np.float32((x[axis] - center[axis]) * scale + offset * n1[axis])
                    b = np.float32((y[axis] - center[axis]) * scale + offset * n2[axis])
                    origins[ray, axis] = a
                    directions[ray, axis] = b - a
                for c in range(seen.shape[1]):
                    value = functions[e, 0, c] + along * functions[e, 1, c] + across * functions[e, 2, c]
                    seen[ray, c] = max(0.0, value)
                weights[ray] = weight
            else:
                weights[ray] = 0.0
                for axis in range(3):
                    origins[ray, axis] = 0.0
                    directions[ray, axis] = 0.0
                for c in range(seen.shape[1]):
                    seen[ray, c] = functions[e, 0, c]


@kernel
def _reduce(
    point: Int64Array,
    factor: FloatArray,
    samples: Int64Array,
    first: Int64Array,
    weights: FloatArray,
    seen: FloatArray,
    channel_weights: FloatArray,
    blocked: BoolArray,
    irradiance: FloatArray,
    variance: FloatArray,
) -> None:
    """Add every entry's irradiance to its point (points, channels), and its squared luminance error."""
    channels = seen.shape[1]
    sums = np.empty(channels)
    for entry in range(len(point)):
        total = 0.0
        square = 0.0
        visible = 0.0
        visible_square = 0.0
        sums[:] = 0.0
        for ray in range(first[entry], first[entry] + samples[entry]):
            w = weights[ray]
            total += w
            square += w * w
            if not blocked[ray]:
                visible += w
                visible_square += w * w
                for c in range(channels):
                    sums[c] += w * seen[ray, c]
        if total <= 0.0:
            continue
        bright = 0.0
        for c in range(channels):
            irradiance[point[entry], c] += factor[entry] * sums[c] / total
            bright += channel_weights[c] * sums[c]
        v = visible / total
        scatter = max(0.0, ((1.0 - 2.0 * v) * visible_square + v * v * square) / (total * total))
        missed = _MISSED / (total * total / square + 1.0)
        mean = bright / visible if visible > 0.0 else 0.0
        variance[point[entry]] += STRATIFIED * (scatter + missed * missed) * (factor[entry] * mean) ** 2
