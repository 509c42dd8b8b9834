"""Where on its triangle a pixel lies ([H 3.4.2]), in the shader and on the CPU by the same steps.

A rasteriser interpolates barycentric coordinates in float32, from screen coordinates: that loses digits on
triangles that are small, clipped or seen at a grazing angle. The point is found anew instead, in float64:
where the ray through the pixel's centre meets the triangle's plane. Two of its coordinates, all but the one
along which the plane's normal is longest, give s and t by a 2 x 2 matrix; which two, and the matrix, make
the triangle's frame. A rasteriser rounds vertices to a part of a pixel, so that a pixel can show a triangle
that its centre just misses, or misses by far where it is seen edge on: s and t are then moved onto it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.parallel import run_chunks
from solver.rendering.projection import PixelRays
from solver.types import AnyArray, Float32Array, FloatArray, IntArray, Points, Vector

_FRAME: Final = np.dtype(
    [
        ("origin", np.float64, 3),
        ("slope", np.float64, 2),
        ("matrix", np.float32, 4),
        ("axis", np.int32),
        ("patch", np.int32),
    ]
)
"""As the shader reads it, in four texels of four words. `origin` is the first corner, its coordinate along
`axis` last and the others in their cyclic order; `slope` tells how the plane falls along those others."""

_TRIANGLES: Final = 1 << 14
"""Triangles of a piece of work"""

_ROWS: Final = 64
"""Rows of a piece of work"""


def frame_records(position: Points, triangles: IntArray, patch: IntArray) -> AnyArray:
    """Frames (t,), as the shader reads them, of triangles on `patch` (t,) over `position` (v, 3)."""
    records = np.zeros(len(triangles), dtype=_FRAME)
    records["patch"] = patch
    run_chunks(
        lambda start, stop: _fill_records(
            start, stop, position, triangles,
            records["origin"], records["slope"], records["matrix"], records["axis"],
        ),
        len(triangles),
        _TRIANGLES,
    )  # fmt: skip
    return records


def locate(
    identity: IntArray, position: Points, triangles: IntArray, eye: Vector, rays: PixelRays
) -> FloatArray:
    """s and t (h, w, 2), each from 0 and together at most 1, of what pixels show of `triangles` (t, 3).

    `identity` (h, w) holds triangles, or -1, where s and t are 0; `rays` go from `eye` (3,), in the
    coordinates of `position` (v, 3).
    """
    found = np.zeros((*identity.shape, 2))
    run_chunks(
        lambda start, stop: _locate(start, stop, identity, position, triangles, eye, rays, found),
        len(identity),
        _ROWS,
    )
    return found


@inline_kernel
def _frame(position: Points, a: int, b: int, c: int) -> tuple[int, float, float, float, float, float, float]:
    """Axis, two slopes and the matrix, row by row, of a triangle; a matrix of 0 where it has no area."""
    ux = position[b, 0] - position[a, 0]
    uy = position[b, 1] - position[a, 1]
    uz = position[b, 2] - position[a, 2]
    vx = position[c, 0] - position[a, 0]
    vy = position[c, 1] - position[a, 1]
    vz = position[c, 2] - position[a, 2]
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    if abs(nx) >= abs(ny) and abs(nx) >= abs(nz):
        axis, along, first, second = 0, nx, ny, nz
        u1, u2, v1, v2 = uy, uz, vy, vz
    elif abs(ny) >= abs(nz):
        axis, along, first, second = 1, ny, nz, nx
        u1, u2, v1, v2 = uz, ux, vz, vx
    else:
        axis, along, first, second = 2, nz, nx, ny
        u1, u2, v1, v2 = ux, uy, vx, vy
    if along == 0.0:
        return axis, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    # The determinant of the two edges is the normal's part along the axis.
    return axis, first / along, second / along, v2 / along, -v1 / along, -u2 / along, u1 / along


@kernel
def _fill_records(
    start: int,
    stop: int,
    position: Points,
    triangles: IntArray,
    origin: FloatArray,
    slope: FloatArray,
    matrix: Float32Array,
    axis: IntArray,
) -> None:
    for k in range(start, stop):
        a = triangles[k, 0]
        along, g1, g2, m0, m1, m2, m3 = _frame(position, a, triangles[k, 1], triangles[k, 2])
        axis[k] = along
        origin[k, 0] = position[a, (along + 1) % 3]
        origin[k, 1] = position[a, (along + 2) % 3]
        origin[k, 2] = position[a, along]
        slope[k, 0] = g1
        slope[k, 1] = g2
        matrix[k, 0] = m0
        matrix[k, 1] = m1
        matrix[k, 2] = m2
        matrix[k, 3] = m3


@kernel
def _locate(
    start: int,
    stop: int,
    identity: IntArray,
    position: Points,
    triangles: IntArray,
    eye: Vector,
    rays: PixelRays,
    found: FloatArray,
) -> None:
    """s and t of the rows from `start` to `stop`."""
    ray = np.empty(3)
    for row in range(start, stop):
        for column in range(identity.shape[1]):
            k = identity[row, column]
            if k < 0:
                continue
            a = triangles[k, 0]
            axis, g1, g2, m0, m1, m2, m3 = _frame(position, a, triangles[k, 1], triangles[k, 2])
            first = (axis + 1) % 3
            second = (axis + 2) % 3
            for i in range(3):
                ray[i] = rays.first[i] + column * rays.across[i] + row * rays.down[i]
            e1 = eye[first] - position[a, first]
            e2 = eye[second] - position[a, second]
            height = (eye[axis] - position[a, axis]) + g1 * e1 + g2 * e2
            falling = ray[axis] + g1 * ray[first] + g2 * ray[second]
            far = -height / falling if falling != 0.0 else 0.0
            x = e1 + far * ray[first]
            y = e2 + far * ray[second]
            s = max(m0 * x + m1 * y, 0.0)
            t = max(m2 * x + m3 * y, 0.0)
            over = max(1.0, s + t)
            found[row, column, 0] = s / over
            found[row, column, 1] = t / over
