"""How far off their surfaces the rays between elements begin: so little that they meet what lies close by.

A ray that begins on a polygon must not meet it. What Embree's float32 may err by is known; and where four
corners are not quite in one plane, the two triangles that Embree has of them are not where the elements are.
"""

from __future__ import annotations

import numpy as np

from solver import tolerances
from solver.types import Corners, FloatArray


def ray_lifts(corners: Corners, normals: FloatArray, size: float) -> FloatArray:
    """By how much, over the scene's `size` (m), rays leave patches (p, 4, 3) along unit normals; (p,)."""
    heights = np.einsum("pki,pi->pk", corners - corners[:, :1], normals)
    return np.asarray(tolerances.LEAST_RAY_OFFSET + np.ptp(heights, axis=1) / size)
