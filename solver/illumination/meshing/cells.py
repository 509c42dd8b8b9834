"""What a triangulation is made of: cells that tile patches, and edges that it must contain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from solver.transport.field import RadiosityField
from solver.types import BoolArray, Corners, FloatArray, IntArray


class Leaves(Protocol):
    """n polygons that tile patches, such as the leaves of a radiosity field; vertices are bit-identical."""

    @property
    def corners(self) -> Corners:
        """(n, 4, 3) metres, counter-clockwise from the front; a triangle repeats its last corner"""
        ...

    @property
    def corner_count(self) -> IntArray:
        """(n,) 3 or 4"""
        ...

    @property
    def patch(self) -> IntArray:
        """(n,) index into the surfaces' patches"""
        ...


@dataclass(frozen=True, eq=False)
class Cells:
    """n convex cells. Those of one patch tile it; vertices that they share are bit-identical."""

    corners: Corners
    """(n, 4, 3) metres, counter-clockwise from the front; a triangle repeats its last corner"""
    corner_count: IntArray
    """(n,) 3 or 4"""
    patch: IntArray
    """(n,) index into the surfaces' patches"""
    leaf: IntArray
    """(n,) what the caller knows a cell by: carried along, never looked at"""

    @classmethod
    def of(cls, field: RadiosityField) -> Cells:
        """The leaves of `field`, known by their index."""
        leaf = np.arange(len(field.patch), dtype=np.int32)
        return cls(field.corners, field.corner_count, field.patch, leaf)


@dataclass(frozen=True, eq=False)
class ConstraintEdges:
    """e line segments along which a triangulation has edges: the discontinuities that are active."""

    patch: IntArray
    """(e,)"""
    ends: FloatArray
    """(e, 2, 3) metres, on the patch's plane and within the patch"""
    set: IntArray
    """(e,) id of the set of collinear discontinuities, not negative"""
    jump: BoolArray
    """(e,) whether the irradiance itself jumps there; elsewhere only a derivative does"""

    def __len__(self) -> int:
        return len(self.patch)

    @classmethod
    def none(cls) -> ConstraintEdges:
        """No edges."""
        return cls(
            np.empty(0, dtype=np.int32),
            np.empty((0, 2, 3)),
            np.empty(0, dtype=np.int32),
            np.empty(0, dtype=np.bool_),
        )

    def take(self, chosen: IntArray) -> ConstraintEdges:
        """Those with the indices `chosen`, in that order."""
        return ConstraintEdges(self.patch[chosen], self.ends[chosen], self.set[chosen], self.jump[chosen])
