"""Maps of a hemisphere on a square: octahedral, so that texels near the horizon are as large as others.

A hemicube spends half of its texels on a quarter of the solid angle, and a paraboloid bends lines. Here the
upper half of an octahedron, seen from above, is a square; no texel has more than 1.7 times the mean solid
angle, and straight lines in space are straight in the map but for a bend where they pass from one face of the
octahedron to the next.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from solver.types import Float32Array, FloatArray


def tangent_frames(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors (m, 3) each that form a right-handed frame with each unit normal (m, 3).

    Source: Duff et al. 2017, which has no branch and no singularity.
    """
    x, y, z = normal.T
    sign = np.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1),
        np.stack([b, sign + y * y * a, -y], axis=1),
    )


@lru_cache(maxsize=4)
def texel_directions(resolution: int) -> Float32Array:
    """Unit directions (resolution^2, 3) of texels' middles about the axis z, row by row."""
    middle = (np.arange(resolution) + 0.5) / resolution * 2.0 - 1.0
    u, v = np.meshgrid(middle, middle)
    x, y = 0.5 * (u + v), 0.5 * (u - v)
    directions = np.stack([x, y, 1.0 - np.abs(x) - np.abs(y)], axis=-1).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions.astype(np.float32)
