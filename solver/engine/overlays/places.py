"""Points that are probed: given in metres on a surface, or as what a pixel shows ([H B.4.9])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.engine.overlays.base import Subject, index_of
from solver.engine.picking import pick_point
from solver.errors import SceneError
from solver.geometry.surfaces import Surfaces
from solver.transport.places import leaves_at
from solver.types import Corners, FloatArray, IntArray, Vector

NEAR: Final = 1e-5
"""A point is on a surface if it is no further from it than this times the scene's size: a client may have it
from a file of float32 numbers."""


@dataclass(frozen=True, eq=False)
class Place:
    """A point of a patch."""

    position: Vector
    """(3,) metres, on the patch's plane"""
    patch: int
    element: int
    """The leaf of the element hierarchy that it lies on"""
    triangle: int | None
    """Of the triangulation; None where there is none"""
    st: FloatArray
    """(2,) place on the triangle"""


@dataclass(frozen=True)
class SurfacePoint:
    """A point in metres."""

    x: float
    y: float
    z: float
    patch: int | None = None
    """Where faces touch: which of them is meant; None: the nearest one, fronts before backs"""

    def find(self, subject: Subject) -> Place:
        """The place. Raises SceneError naming x where no surface is, or patch."""
        surfaces = subject.world.surfaces
        position = np.array([self.x, self.y, self.z])
        away = _distances(surfaces, position)
        if self.patch is not None:
            index_of(self.patch, surfaces.patch_count, "patch", "patches")
            patch = self.patch
        elif surfaces.patch_count == 0:
            raise SceneError("the scene has no surface", ("x",))
        else:
            near = away <= away.min() + 1e-3 * NEAR * surfaces.size
            patch = int(np.flatnonzero(near)[np.argmin(surfaces.side[near])])
        if away[patch] > NEAR * surfaces.size:
            which = "that patch" if self.patch is not None else "the nearest surface"
            raise SceneError(f"the point is {away[patch]:.3g} m away from {which}", ("x",))
        offset = (position - surfaces.corners[patch, 0]) @ surfaces.normal[patch]
        return _place(subject, position - offset * surfaces.normal[patch], patch)


@dataclass(frozen=True)
class Pixel:
    """A pixel of the camera's frame, from 0 at the top left."""

    x: int
    y: int

    def find(self, subject: Subject) -> Place:
        """The place that it shows. Raises SceneError naming x or y where it shows none."""
        fine = subject.fine
        mesh = None if fine is None else fine.mesh()
        found = pick_point(subject.solution, mesh, subject.drawing, subject.camera, self.x, self.y)
        if found is None:
            raise SceneError("this pixel shows nothing", ("x",))
        return _place(subject, found.seen.position, found.seen.patch)


Address = SurfacePoint | Pixel


def _place(subject: Subject, position: Vector, patch: int) -> Place:
    tree = subject.solution.solver.state.tree
    element = int(leaves_at(tree, position[None], np.array([patch], dtype=np.int32))[0])
    interpolants = None if subject.fine is None else subject.fine.interpolants
    if interpolants is None:
        return Place(position, patch, element, None, np.zeros(2))
    mesh = interpolants.triangulation
    first, last = mesh.triangle_start[patch], mesh.triangle_start[patch + 1]
    corners = mesh.position[mesh.triangles[first:last]]
    st = _coordinates(corners, position)
    inside = np.minimum(st.min(axis=1), 1.0 - st.sum(axis=1))
    best = int(np.argmax(inside))
    triangle = int(first) + best
    leaf = int(tree.leaves[mesh.leaf[triangle]])
    return Place(position, patch, leaf, triangle, _clipped(st[best]))


def _distances(surfaces: Surfaces, position: Vector) -> FloatArray:
    """(p,) m from a point to each patch, or a little less where the nearest part of it is a corner."""
    above = np.einsum("pa,pa->p", position - surfaces.corners[:, 0], surfaces.normal)
    beside = _border_heights(surfaces.corners, surfaces.corner_count, surfaces.normal, position)
    return np.asarray(np.hypot(above, np.minimum(beside, 0.0)))


def _border_heights(corners: Corners, count: IntArray, normal: FloatArray, position: Vector) -> FloatArray:
    """(n,) m by which a point is inside the sides of each convex polygon (n, 4, 3); negative outside."""
    along = np.roll(corners, -1, axis=1) - corners
    # A triangle's last corner is there twice: its third side is that of the second of them.
    is_side = np.arange(4) != np.where(count == 3, 2, -1)[:, None]
    inward = np.cross(normal[:, None], along)
    length = np.linalg.norm(inward, axis=2)
    height = np.einsum("nka,nka->nk", position - corners, inward) / np.where(length > 0.0, length, 1.0)
    return np.asarray(np.where(is_side, height, np.inf).min(axis=1))


def _coordinates(corners: FloatArray, position: Vector) -> FloatArray:
    """(n, 2) s, t of a point by each triangle (n, 3, 3)."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    w = position - corners[:, 0]
    uu, uv, vv = (np.einsum("na,na->n", a, b) for a, b in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("na,na->n", w, u), np.einsum("na,na->n", w, v)
    determinant = uu * vv - uv * uv
    return np.asarray(np.stack([vv * wu - uv * wv, uu * wv - uv * wu], axis=1) / determinant[:, None])


def _clipped(st: FloatArray) -> FloatArray:
    """The place, moved into its triangle where rounding has put it outside."""
    inside = st.clip(0.0, 1.0)
    return np.asarray(inside / max(1.0, float(inside.sum())))
