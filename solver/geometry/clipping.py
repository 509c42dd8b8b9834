"""Clipping of convex polygons by planes, as kernels over small arrays that the caller provides."""

from __future__ import annotations

from solver.kernels import kernel
from solver.types import FloatArray


@kernel
def clip_to_plane(
    polygon: FloatArray, count: int, normal: FloatArray, offset: float, tolerance: float, out: FloatArray
) -> int:
    """Keep the part of a convex polygon with normal . x > offset; those within `tolerance` stay.

    polygon (>= count, 3); normal (3,); out (>= count + 1, 3) receives the vertices in the same order;
    returns their number, 0 if nothing lies more than `tolerance` above the plane. [H 6.2.1]
    """
    above = False
    below = False
    for k in range(count):
        height = normal[0] * polygon[k, 0] + normal[1] * polygon[k, 1] + normal[2] * polygon[k, 2] - offset
        if height > tolerance:
            above = True
        elif height < -tolerance:
            below = True
    if not above:
        return 0
    if not below:
        for k in range(count):
            for axis in range(3):
                out[k, axis] = polygon[k, axis]
        return count
    kept = 0
    last = count - 1
    height_a = (
        normal[0] * polygon[last, 0] + normal[1] * polygon[last, 1] + normal[2] * polygon[last, 2] - offset
    )
    for k in range(count):
        height_b = normal[0] * polygon[k, 0] + normal[1] * polygon[k, 1] + normal[2] * polygon[k, 2] - offset
        if (height_a > tolerance and height_b < -tolerance) or (
            height_a < -tolerance and height_b > tolerance
        ):
            t = height_a / (height_a - height_b)
            for axis in range(3):
                out[kept, axis] = polygon[last, axis] + t * (polygon[k, axis] - polygon[last, axis])
            kept += 1
        if height_b >= -tolerance:
            for axis in range(3):
                out[kept, axis] = polygon[k, axis]
            kept += 1
        last = k
        height_a = height_b
    return kept
