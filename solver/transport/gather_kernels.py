"""Kernels of the gather at points: what a point sees, rays towards it, and their sums."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import kernel
from solver.transport.lambert import point_form_factor
from solver.types import BoolArray, Corners, Float32Array, FloatArray, Int64Array, IntArray, Points
from solver.visibility.fraction import MISSED, STRATIFIED
from solver.visibility.sampling import fraction_of, hash_index, sample_by_solid_angle, sample_element

LEVEL: Final = 1e-3
"""An element is entered while its radiosity residual brings more than this share of the irradiance."""

_NEAR: Final = 16.0
# The R2 sequence.
_ROOT: Final = 1.3247179572447460
_DEPTH: Final = 256


@kernel
def collect_elements(
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
def generate_rays(
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
    """Rays of entries [start, stop), their weights, and the radiosities (rays, channels) they would see."""
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
            u = fraction_of(shift_u + (s + 1) / _ROOT)
            v = fraction_of(shift_v + (s + 1) / (_ROOT * _ROOT))
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
def add_up(
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
        bright = 0.0
        if total <= 0.0:
            # No sample lies above the horizon, though a part of the element does: taken as seen.
            for c in range(channels):
                value = max(0.0, seen[first[entry], c])
                irradiance[point[entry], c] += factor[entry] * value
                bright += channel_weights[c] * value
            variance[point[entry]] += (factor[entry] * bright) ** 2
            continue
        for c in range(channels):
            irradiance[point[entry], c] += factor[entry] * sums[c] / total
            bright += channel_weights[c] * sums[c]
        v = visible / total
        scatter = max(0.0, ((1.0 - 2.0 * v) * visible_square + v * v * square) / (total * total))
        missed = MISSED / (total * total / square + 1.0)
        mean = bright / visible if visible > 0.0 else 0.0
        variance[point[entry]] += STRATIFIED * (scatter + missed * missed) * (factor[entry] * mean) ** 2
