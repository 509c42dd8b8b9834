"""Irradiance at points: the gather over the hierarchical solution, each element at the level it deserves.

From every patch a point descends as far as the radiosity residual, times the point's form factor, is
felt; a form factor is Lambert's contour formula over the part above the point's horizon [H eq. 6.1].
Occlusion is sampled: every element gets rays in proportion to the light it could bring, distributed by
the cosine-weighted solid angle under which it is seen, and the radiosity counts where it is seen.
Where nothing is in the way the result is exact for the solution as it stands.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.parallel import run_chunks
from solver.transport.gather_kernels import add_up, collect_elements, generate_rays
from solver.transport.oracle import element_residuals
from solver.transport.pushpull import pull
from solver.transport.state import TransportState
from solver.types import Float32Array, FloatArray, Int64Array, IntArray, Points
from solver.visibility.rays import RayScene

RAYS_AT_ONCE: Final = 1 << 18


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
            collect_elements(
                x, normal, tree.patch_count, tree.child, tree.child_count, tree.corners, tree.corner_count,
                luminance, spread, write, start, stop, total, slot, element, factor,
            )  # fmt: skip

        run_chunks(lambda a, b: collect(a, b, False, count, empty, nothing), len(x), 16, 1)  # noqa: B023
        slot = np.cumsum(count) - count
        entries = int(count.sum())
        element, factor = np.empty(entries, dtype=np.int32), np.empty(entries)
        run_chunks(lambda a, b: collect(a, b, True, slot, element, factor), len(x), 16, 1)  # noqa: B023
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
            generate_rays(
                x, normal, point, element, samples, ray, tree.corners, tree.corner_count, tree.area,
                tree.patch, tree.patch_normal, tree.axes, tree.centroid, size, functions, rays.center,
                rays.scale, rays.offset, start, stop, origins, directions, weights, seen,
            )  # fmt: skip

        run_chunks(generate, entries, 512, 32)
        blocked = rays.occluded_local(origins, directions)
        variance = np.zeros(len(x))
        add_up(
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
        tree.child, tree.child_count, tree.area, tree.moment, moments @ state.weights,
        np.zeros(len(tree)), spread,
    )  # fmt: skip
    uu, uv, vv = (tree.moment[:, k, None] for k in range(3))
    determinant = uu * vv - uv * uv
    functions = moments.copy()
    functions[:, 1] = (vv * moments[:, 1] - uv * moments[:, 2]) / determinant
    functions[:, 2] = (uu * moments[:, 2] - uv * moments[:, 1]) / determinant
    return functions, spread
