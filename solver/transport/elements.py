"""The element hierarchy: a quadtree over every patch, all trees in one set of arrays ([H 4.1]).

Nodes 0 .. p-1 are the patches themselves; children are appended, always behind their parent, so that one
backward sweep pulls and one forward sweep pushes. A quadrilateral or triangle splits into four at its
edge midpoints; a quadrilateral at least twice as long as wide splits into two across its length, so that
slivers do not breed slivers. Midpoints are computed alike from either side of an edge: vertices that
neighbours share are bit-identical.

An element carries linear functions of position: f(x) = mean + gradient . (x - centroid), x in the two
axes of its patch. Hence its centroid, its second moments and its place in its parent are kept.
"""

from __future__ import annotations

import numpy as np

from solver.arrays import GrowingArray
from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.types import Corners, FloatArray, IntArray, Points


class ElementTree:
    """Struct of growing arrays; every property is a view over the live elements."""

    def __init__(self, surfaces: Surfaces) -> None:
        n = surfaces.patch_count
        self.patch_count = n
        self.patch_normal = surfaces.normal
        self.axes = plane_axes(surfaces.normal)
        """(p, 2, 3) orthonormal axes of each patch's plane"""
        self._corners = GrowingArray((4, 3), np.float64, n + 1024)
        self._corner_count = GrowingArray((), np.int32, n + 1024)
        self._patch = GrowingArray((), np.int32, n + 1024)
        self._parent = GrowingArray((), np.int32, n + 1024)
        self._child = GrowingArray((), np.int32, n + 1024)
        self._child_count = GrowingArray((), np.int32, n + 1024)
        self._area = GrowingArray((), np.float64, n + 1024)
        self._centroid = GrowingArray((3,), np.float64, n + 1024)
        self._moment = GrowingArray((3,), np.float64, n + 1024)
        self._offset = GrowingArray((2,), np.float64, n + 1024)
        self._corners.append(surfaces.corners)
        self._corner_count.append(surfaces.corner_count)
        self._patch.append(np.arange(n, dtype=np.int32))
        self._parent.append(np.full(n, -1, dtype=np.int32))
        self._child.append(np.full(n, -1, dtype=np.int32))
        self._child_count.grow(n)
        self._area.append(surfaces.area)
        for array in (self._centroid, self._moment, self._offset):
            array.grow(n)
        self._place(0)

    def __len__(self) -> int:
        return len(self._area)

    @property
    def corners(self) -> Corners:
        """(n, 4, 3) metres"""
        return self._corners.live

    @property
    def corner_count(self) -> IntArray:
        """(n,) 3 or 4"""
        return self._corner_count.live

    @property
    def patch(self) -> IntArray:
        """(n,) the patch an element belongs to"""
        return self._patch.live

    @property
    def parent(self) -> IntArray:
        """(n,) -1 for a patch"""
        return self._parent.live

    @property
    def child(self) -> IntArray:
        """(n,) first child, -1 for a leaf"""
        return self._child.live

    @property
    def child_count(self) -> IntArray:
        """(n,) 0, 2 or 4"""
        return self._child_count.live

    @property
    def area(self) -> FloatArray:
        """(n,) m2"""
        return self._area.live

    @property
    def centroid(self) -> Points:
        """(n, 3) metres"""
        return self._centroid.live

    @property
    def moment(self) -> FloatArray:
        """(n, 3) mean of uu, uv, vv over the element, m2; u, v from the centroid, by the patch's axes"""
        return self._moment.live

    @property
    def offset(self) -> FloatArray:
        """(n, 2) centroid less the parent's, m, by the patch's axes; 0 for patches"""
        return self._offset.live

    @property
    def leaves(self) -> IntArray:
        """Indices of the leaves, ascending."""
        return np.flatnonzero(self.child < 0).astype(np.int32)

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return sum(
            array.nbytes
            for array in (
                self._corners,
                self._corner_count,
                self._patch,
                self._parent,
                self._child,
                self._child_count,
                self._area,
                self._centroid,
                self._moment,
                self._offset,
            )
        )

    def split(self, ids: IntArray) -> None:
        """Give children to the leaves `ids` (unique)."""
        if len(ids) == 0:
            return
        counts = np.empty(len(ids), dtype=np.int32)
        _count_children(self.corners, self.corner_count, ids, counts)
        first = len(self) + np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int32)
        total = int(counts.sum())
        for array in (
            self._corners,
            self._corner_count,
            self._patch,
            self._parent,
            self._child_count,
            self._area,
            self._centroid,
            self._moment,
            self._offset,
        ):
            array.grow(total)
        self._child.grow(total)[...] = -1
        self.child[ids] = first
        self.child_count[ids] = counts
        _make_children(
            ids, first, counts, self.corners, self.corner_count, self.patch, self.parent, self.area
        )
        self._place(len(self) - total)

    def _place(self, start: int) -> None:
        """Find centroids, moments and offsets of the elements from `start` on."""
        _place_elements(
            self.corners, self.corner_count, self.patch, self.parent, self.axes, start, self.centroid,
            self.moment, self.offset,
        )  # fmt: skip


def plane_axes(normals: FloatArray) -> FloatArray:
    """Two orthonormal axes (p, 2, 3) of the planes with unit normals (p, 3), right-handed with them."""
    helper = np.eye(3)[np.argmin(np.abs(normals), axis=1)] if len(normals) else np.empty((0, 3))
    first = np.cross(helper, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.ascontiguousarray(np.stack([first, np.cross(normals, first)], axis=1))


@kernel
def _edge_squares(corners: FloatArray) -> tuple[float, float]:
    """Squared mean lengths of a quadrilateral's two pairs of opposite sides."""
    u = 0.0
    v = 0.0
    for axis in range(3):
        u += (corners[1, axis] - corners[0, axis] + corners[2, axis] - corners[3, axis]) ** 2
        v += (corners[3, axis] - corners[0, axis] + corners[2, axis] - corners[1, axis]) ** 2
    return u, v


@kernel
def _count_children(corners: Corners, corner_count: IntArray, ids: IntArray, counts: IntArray) -> None:
    for i in range(len(ids)):
        counts[i] = 4
        if corner_count[ids[i]] == 4:
            u, v = _edge_squares(corners[ids[i]])
            if u >= 4.0 * v or v >= 4.0 * u:
                counts[i] = 2


@kernel
def _make_children(
    ids: IntArray,
    first: IntArray,
    counts: IntArray,
    corners: Corners,
    corner_count: IntArray,
    patch: IntArray,
    parent: IntArray,
    area: FloatArray,
) -> None:
    middle = np.empty((4, 3))
    center = np.empty(3)
    for i in range(len(ids)):
        e = ids[i]
        n = corner_count[e]
        for k in range(n):
            for axis in range(3):
                middle[k, axis] = 0.5 * (corners[e, k, axis] + corners[e, (k + 1) % n, axis])
        f = first[i]
        if n == 3:
            for k in range(3):
                for axis in range(3):
                    corners[f + k, 0, axis] = corners[e, k, axis]
                    corners[f + k, 1, axis] = middle[k, axis]
                    corners[f + k, 2, axis] = middle[(k + 2) % 3, axis]
                    corners[f + 3, k, axis] = middle[k, axis]
            for k in range(4):
                for axis in range(3):
                    corners[f + k, 3, axis] = corners[f + k, 2, axis]
        elif counts[i] == 4:
            for axis in range(3):
                center[axis] = 0.5 * (
                    0.5 * (corners[e, 0, axis] + corners[e, 1, axis])
                    + 0.5 * (corners[e, 2, axis] + corners[e, 3, axis])
                )
            for k in range(4):
                for axis in range(3):
                    corners[f + k, k, axis] = corners[e, k, axis]
                    corners[f + k, (k + 1) % 4, axis] = middle[k, axis]
                    corners[f + k, (k + 2) % 4, axis] = center[axis]
                    corners[f + k, (k + 3) % 4, axis] = middle[(k + 3) % 4, axis]
        else:
            u, v = _edge_squares(corners[e])
            along = 0 if u >= v else 1
            # Cut sides `along` and `along + 2` at their middles.
            a = along
            b = (along + 1) % 4
            c = (along + 2) % 4
            d = (along + 3) % 4
            for axis in range(3):
                corners[f, a, axis] = corners[e, a, axis]
                corners[f, b, axis] = middle[a, axis]
                corners[f, c, axis] = middle[c, axis]
                corners[f, d, axis] = corners[e, d, axis]
                corners[f + 1, a, axis] = middle[a, axis]
                corners[f + 1, b, axis] = corners[e, b, axis]
                corners[f + 1, c, axis] = corners[e, c, axis]
                corners[f + 1, d, axis] = middle[c, axis]
        total = 0.0
        for k in range(counts[i]):
            c = f + k
            corner_count[c] = n
            patch[c] = patch[e]
            parent[c] = e
            area[c] = polygon_area(corners[c])
            total += area[c]
        # The children's areas sum to the parent's to the last digit that matters to energy.
        for k in range(counts[i]):
            area[f + k] *= area[e] / total


@kernel
def polygon_area(corners: FloatArray) -> float:
    """Area of a planar convex quadrilateral (4, 3), or of a triangle that repeats its last corner."""
    ax = corners[2, 0] - corners[0, 0]
    ay = corners[2, 1] - corners[0, 1]
    az = corners[2, 2] - corners[0, 2]
    bx = corners[3, 0] - corners[1, 0]
    by = corners[3, 1] - corners[1, 1]
    bz = corners[3, 2] - corners[1, 2]
    cx = ay * bz - az * by
    cy = az * bx - ax * bz
    cz = ax * by - ay * bx
    return 0.5 * np.sqrt(cx * cx + cy * cy + cz * cz)


@kernel
def _place_elements(
    corners: Corners,
    corner_count: IntArray,
    patch: IntArray,
    parent: IntArray,
    axes: FloatArray,
    start: int,
    centroid: Points,
    moment: FloatArray,
    offset: FloatArray,
) -> None:
    x = np.empty((4, 2))
    for e in range(start, len(corners)):
        u = axes[patch[e], 0]
        v = axes[patch[e], 1]
        n = corner_count[e]
        for k in range(n):
            x[k, :] = 0.0
            for axis in range(3):
                d = corners[e, k, axis] - corners[e, 0, axis]
                x[k, 0] += d * u[axis]
                x[k, 1] += d * v[axis]
        # One or two triangles; a triangle with corners a, b, c at mean m has the second moments
        # (a a + b b + c c + 9 m m) / 12.
        weight = 0.0
        cu = cv = uu = uv = vv = 0.0
        for k in range(1, n - 1):
            w = x[k, 0] * x[k + 1, 1] - x[k, 1] * x[k + 1, 0]
            mu = (x[k, 0] + x[k + 1, 0]) / 3.0
            mv = (x[k, 1] + x[k + 1, 1]) / 3.0
            weight += w
            cu += w * mu
            cv += w * mv
            uu += w * (x[k, 0] ** 2 + x[k + 1, 0] ** 2 + 9.0 * mu * mu) / 12.0
            uv += w * (x[k, 0] * x[k, 1] + x[k + 1, 0] * x[k + 1, 1] + 9.0 * mu * mv) / 12.0
            vv += w * (x[k, 1] ** 2 + x[k + 1, 1] ** 2 + 9.0 * mv * mv) / 12.0
        cu /= weight
        cv /= weight
        moment[e, 0] = uu / weight - cu * cu
        moment[e, 1] = uv / weight - cu * cv
        moment[e, 2] = vv / weight - cv * cv
        for axis in range(3):
            centroid[e, axis] = corners[e, 0, axis] + cu * u[axis] + cv * v[axis]
        offset[e, :] = 0.0
        if parent[e] >= 0:
            for axis in range(3):
                d = centroid[e, axis] - centroid[parent[e], axis]
                offset[e, 0] += d * u[axis]
                offset[e, 1] += d * v[axis]
