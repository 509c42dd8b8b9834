"""Where places lie in an earlier mesh over the same leaves, and what its interpolants tell there."""

from __future__ import annotations

import numpy as np

from solver.illumination.interpolation.fit import fit_interpolants
from solver.illumination.meshing.triangulation import Triangulation
from solver.kernels import kernel
from solver.types import FloatArray, Int64Array, IntArray, Points, Spectra


def triangles_at(mesh: Triangulation, positions: Points, leaf: IntArray) -> tuple[IntArray, FloatArray]:
    """The triangle (n,) of `mesh` that holds each position (n, 3) on a leaf (n,), or is closest to doing so.

    And where in it that is: s and t (n, 2), 0 at the first corner, 1 at the second and at the third. The
    triangle is -1 where the leaf has none.
    """
    order = np.argsort(mesh.leaf, kind="stable").astype(np.int32)
    leaves = max(int(mesh.leaf.max(initial=-1)), int(leaf.max(initial=-1))) + 1
    first = np.searchsorted(mesh.leaf[order], np.arange(leaves + 1)).astype(np.int64)
    found = np.full(len(positions), -1, dtype=np.int32)
    place = np.zeros((len(positions), 2))
    _locate(mesh.position, mesh.triangles, order, first, positions, leaf, found, place)
    return found, place


def told_at(node: IntArray, values: Spectra, triangle: IntArray, place: FloatArray) -> Spectra:
    """Irradiance (n, channels), never negative, that quadratics through samples node (t, 6) of values tell.

    At places s, t (n, 2) of triangles (n,), by [H eq. 3.1].
    """
    c = fit_interpolants(node[triangle], values)[:, :, : values.shape[1]].astype(np.float64)
    s, t = place[:, :1], place[:, 1:]
    told = (c[:, 0] * s + c[:, 1] * t + c[:, 2]) * s + (c[:, 3] * t + c[:, 4]) * t + c[:, 5]
    return np.asarray(np.maximum(told, 0.0))


@kernel
def _locate(
    vertices: Points,
    triangles: IntArray,
    order: IntArray,
    first: Int64Array,
    positions: Points,
    leaf: IntArray,
    found: IntArray,
    place: FloatArray,
) -> None:
    for i in range(len(positions)):
        best = -np.inf
        for k in range(first[leaf[i]], first[leaf[i] + 1]):
            triangle = order[k]
            aa = ab = bb = ap = bp = 0.0
            for axis in range(3):
                origin = vertices[triangles[triangle, 0], axis]
                a = vertices[triangles[triangle, 1], axis] - origin
                b = vertices[triangles[triangle, 2], axis] - origin
                p = positions[i, axis] - origin
                aa += a * a
                ab += a * b
                bb += b * b
                ap += a * p
                bp += b * p
            determinant = aa * bb - ab * ab
            if determinant <= 0.0:
                continue
            s = (bb * ap - ab * bp) / determinant
            t = (aa * bp - ab * ap) / determinant
            inside = min(s, t, 1.0 - s - t)
            if inside > best:
                best = inside
                found[i] = triangle
                place[i, 0] = s
                place[i, 1] = t
            if inside >= 0.0:
                break
