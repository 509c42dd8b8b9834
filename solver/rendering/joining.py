"""Interpolants of some triangles, and the elements of a field beside them, as one mesh."""

from __future__ import annotations

import numpy as np

from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.meshes import triangle_patches
from solver.rendering.tessellation import RenderMesh
from solver.types import BoolArray, Float32Array, IntArray, Points


def join(
    position: Points,
    triangles: IntArray,
    coefficients: Float32Array,
    patch: IntArray,
    elements: RenderMesh,
    shown: BoolArray,
) -> InterpolantMesh:
    """Triangles (t, 3) over positions (v, 3), metres, of patches (t,), with coefficients (t, 6, 3); and of
    `elements` the leaves (n,) that are `shown`, on which light is linear over each triangle.

    Vertices of both in one place coincide, but neither has all of the other's. Of what is known of leaves
    and errors, nothing is told.
    """
    surfaces = elements.surfaces
    beside = np.flatnonzero(shown[elements.leaf])
    added = elements.triangles[beside]
    linear = np.zeros((len(beside), *coefficients.shape[1:]), dtype=np.float32)
    at = elements.irradiance[added]
    linear[:, 2], linear[:, 4], linear[:, 5] = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0], at[:, 0]
    vertex_patch = np.zeros(len(position), dtype=np.int32)
    vertex_patch[triangles] = patch[:, None]
    # Which of two patches at one depth is drawn must not depend on which of them is shown by elements.
    order = np.argsort(np.concatenate([patch, triangle_patches(elements)[beside]]), kind="stable")
    t = len(order)
    return InterpolantMesh(
        surfaces=surfaces,
        position=np.concatenate([position, elements.position * surfaces.size + surfaces.center]),
        patch=np.concatenate([vertex_patch, elements.patch]),
        triangles=np.concatenate([triangles, added + np.int32(len(position))])[order],
        leaf=np.zeros(t, dtype=np.int32),
        coefficients=np.concatenate([coefficients, linear])[order],
        error=np.full(t, np.nan, dtype=np.float32),
        is_fine=np.zeros(t, dtype=np.bool_),
        leaf_irradiance=np.zeros((1, 3)),
    )
