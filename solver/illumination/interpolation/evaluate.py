"""Interpolants evaluated on the CPU ([H B.3.3], LerpShade): what their frames must show."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import Float32Array, FloatArray, IntArray

_POINTS: Final = 1 << 15
"""Points of a piece of work"""


def evaluate_interpolants(mesh: InterpolantMesh, triangle: IntArray, barycentric: FloatArray) -> FloatArray:
    """Irradiance (n, 3) W/m2 at the points s, t of `barycentric` (n, 2) on triangles (n,) of `mesh`.

    By [H eq. 3.1], never negative: a quadratic may dip below 0 between positive samples. 0 where the triangle
    is -1, which is nothing. Raises IndexError for a triangle that the mesh does not have.
    """
    count = len(mesh.coefficients)
    if len(triangle) and (triangle.min() < -1 or triangle.max() >= count):
        raise IndexError(f"the mesh has triangles 0 to {count - 1}, and -1 stands for none")
    irradiance = np.zeros((len(triangle), 3))
    run_chunks(
        lambda start, stop: _evaluate(start, stop, mesh.coefficients, triangle, barycentric, irradiance),
        len(triangle),
        _POINTS,
    )
    return irradiance


@kernel
def _evaluate(
    start: int,
    stop: int,
    coefficients: Float32Array,
    triangle: IntArray,
    barycentric: FloatArray,
    irradiance: FloatArray,
) -> None:
    for i in range(start, stop):
        k = triangle[i]
        if k < 0:
            continue
        s = barycentric[i, 0]
        t = barycentric[i, 1]
        for c in range(3):
            along_s = coefficients[k, 0, c] * s + coefficients[k, 1, c] * t + coefficients[k, 2, c]
            along_t = coefficients[k, 3, c] * t + coefficients[k, 4, c]
            irradiance[i, c] = max(along_s * s + along_t * t + coefficients[k, 5, c], 0.0)
