"""The element hierarchy: a quadtree over every patch, all trees in one set of arrays ([H 4.1]).

Nodes 0 .. p-1 are the patches themselves; children are appended, always behind their parent, so that one
backward sweep pulls and one forward sweep pushes.

An element carries linear functions of position: f(x) = mean + gradient . (x - centroid), x in the two
axes of its patch. Hence its centroid, its second moments and its place in its parent are kept.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from solver.arrays import GrowingArray
from solver.geometry.surfaces import Surfaces
from solver.transport.subdivision import count_children, make_children, place_elements, place_keys
from solver.types import BoolArray, Corners, FloatArray, Int64Array, IntArray, Points

_COPIED: Final = ("corners", "corner_count", "child_count", "area", "centroid", "moment", "offset", "key")
"""What a patch's elements keep when others come and go; the rest are numbers of patches and elements."""


class ElementTree:
    """Struct of growing arrays; every property is a view over the live elements."""

    def __init__(self, surfaces: Surfaces, more: int = 0) -> None:
        """The patches of `surfaces`, with room for `more` elements."""
        n = surfaces.patch_count
        room = n + more + more // 16 + 1024
        self.patch_count = n
        self.patch_normal = surfaces.normal
        self.axes = plane_axes(surfaces.normal)
        """(p, 2, 3) orthonormal axes of each patch's plane"""
        self._corners = GrowingArray((4, 3), np.float64, room)
        self._corner_count = GrowingArray((), np.int32, room)
        self._patch = GrowingArray((), np.int32, room)
        self._parent = GrowingArray((), np.int32, room)
        self._child = GrowingArray((), np.int32, room)
        self._child_count = GrowingArray((), np.int32, room)
        self._area = GrowingArray((), np.float64, room)
        self._centroid = GrowingArray((3,), np.float64, room)
        self._moment = GrowingArray((3,), np.float64, room)
        self._offset = GrowingArray((2,), np.float64, room)
        self._key = GrowingArray((), np.int64, room)
        self._corners.append(surfaces.corners)
        self._corner_count.append(surfaces.corner_count)
        self._patch.append(np.arange(n, dtype=np.int32))
        self._parent.append(np.full(n, -1, dtype=np.int32))
        self._child.append(np.full(n, -1, dtype=np.int32))
        self._child_count.grow(n)
        self._area.append(surfaces.area)
        for array in (self._centroid, self._moment, self._offset, self._key):
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
    def key(self) -> Int64Array:
        """(n,) told from where an element is: what its rays go by, whatever number it has"""
        return self._key.live

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
                self._key,
            )
        )

    def split(self, ids: IntArray) -> None:
        """Give children to the leaves `ids` (unique)."""
        if len(ids) == 0:
            return
        counts = np.empty(len(ids), dtype=np.int32)
        count_children(self.corners, self.corner_count, ids, counts)
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
            self._key,
        ):
            array.grow(total)
        self._child.grow(total)[...] = -1
        self.child[ids] = first
        self.child_count[ids] = counts
        make_children(ids, first, counts, self.corners, self.corner_count, self.patch, self.parent, self.area)
        self._place(len(self) - total)

    def without(self, gone: BoolArray) -> tuple[ElementTree, IntArray]:
        """The tree without the elements `gone` (n,), all children of an element or none, and all below them.

        Returns the new number of each element (n,) too, -1 where it is gone.
        """
        tree = object.__new__(ElementTree)
        tree.patch_count, tree.patch_normal, tree.axes = self.patch_count, self.patch_normal, self.axes
        kept = np.flatnonzero(~gone)
        number = np.full(len(self), -1, dtype=np.int32)
        number[kept] = np.arange(len(kept), dtype=np.int32)
        for name in (*_COPIED, "patch", "parent", "child"):
            mine: GrowingArray[Any] = getattr(self, f"_{name}")
            column = GrowingArray(mine.live.shape[1:], mine.live.dtype.type, len(kept) + len(kept) // 16)
            column.append(mine.live[kept])
            setattr(tree, f"_{name}", column)
        inner = tree.parent >= 0
        tree.parent[inner] = number[tree.parent[inner]]
        split = tree.child >= 0
        tree.child[split] = number[tree.child[split]]
        tree.child_count[tree.child < 0] = 0
        return tree, number

    @staticmethod
    def carried(surfaces: Surfaces, earlier: ElementTree, patch: IntArray) -> tuple[ElementTree, IntArray]:
        """The tree of new surfaces, with what the patches of an earlier tree that are still there had.

        patch (p,) is the new number of each earlier patch, -1 where it is gone. Returns the same of each
        earlier element (n,) too.
        """
        before = earlier.patch_count
        inner = np.flatnonzero(patch[earlier.patch[before:]] >= 0) + before
        tree = ElementTree(surfaces, len(inner))
        number = np.full(len(earlier), -1, dtype=np.int32)
        number[:before] = patch
        number[inner] = np.arange(len(inner), dtype=np.int32) + tree.patch_count
        for name in _COPIED:
            column = getattr(tree, f"_{name}")
            first = column.extend(len(inner))
            np.take(getattr(earlier, name), inner, axis=0, out=column.live[first:], mode="clip")
        tree._patch.append(patch[earlier.patch[inner]])
        tree._parent.append(number[earlier.parent[inner]])
        child = earlier.child[inner]
        tree._child.append(np.where(child >= 0, number[child], -1))
        stays = np.flatnonzero(patch >= 0)
        child = earlier.child[stays]
        tree.child[patch[stays]] = np.where(child >= 0, number[child], -1)
        tree.child_count[patch[stays]] = earlier.child_count[stays]
        return tree, number

    def move(self, surfaces: Surfaces, patches: IntArray) -> None:
        """Put `patches` (k,), which are leaves, where `surfaces` have those of their numbers."""
        self.patch_normal = surfaces.normal
        self.axes[patches] = axes = plane_axes(surfaces.normal[patches])
        self.corners[patches] = corners = surfaces.corners[patches]
        self.area[patches] = surfaces.area[patches]
        k = len(patches)
        centroid, moment, offset = np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 2))
        number, none = np.arange(k, dtype=np.int32), np.full(k, -1, dtype=np.int32)
        place_elements(corners, self.corner_count[patches], number, none, axes, 0, centroid, moment, offset)
        self.centroid[patches], self.moment[patches] = centroid, moment
        self.key[patches] = place_keys(centroid)

    def _place(self, start: int) -> None:
        """Find centroids, moments and offsets of the elements from `start` on."""
        place_elements(
            self.corners, self.corner_count, self.patch, self.parent, self.axes, start, self.centroid,
            self.moment, self.offset,
        )  # fmt: skip
        self.key[start:] = place_keys(self.centroid[start:])


def plane_axes(normals: FloatArray) -> FloatArray:
    """Two orthonormal axes (p, 2, 3) of the planes with unit normals (p, 3), right-handed with them."""
    helper = np.eye(3)[np.argmin(np.abs(normals), axis=1)] if len(normals) else np.empty((0, 3))
    first = np.cross(helper, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.ascontiguousarray(np.stack([first, np.cross(normals, first)], axis=1))
