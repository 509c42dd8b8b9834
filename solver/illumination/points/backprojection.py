"""The backprojection of a point: what it sees of every source, as polygons ([H 6.2, B.4.10])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.obstacles import find_obstacles
from solver.geometry.surfaces import Surfaces
from solver.illumination.points.cuts import ABOVE, ROOM, WHOLE, clip_above
from solver.illumination.points.desk import Elements, Light, make_desk, relative_polygon
from solver.illumination.points.gather_anywhere import PLANES, point_shaft, seen_sources
from solver.illumination.points.point_irradiance import ON_PLANE, ON_SURFACE
from solver.illumination.points.pyramids import HIDDEN, cull, make_sight
from solver.illumination.points.visible_parts import clip_by_pyramids, factor_of
from solver.kernels import kernel
from solver.types import FloatArray, Int64Array, IntArray, Points, Vector
from solver.visibility.bvh import Hierarchy, walk_hierarchy

_PIECES: Final = 1024
"""Visible pieces for which there is room at first."""


@dataclass(frozen=True, eq=False)
class Backprojection:
    """What a point sees of s sources: the patches asked for that show it their fronts above its horizon."""

    patch: IntArray
    """(s,)"""
    corners: FloatArray
    """(s, ROOM, 3) metres: the part of each source above the horizon, convex"""
    corner_count: IntArray
    """(s,)"""
    first: Int64Array
    """(s + 1,) where the visible pieces of each source begin"""
    pieces: FloatArray
    """(m, ROOM, 3) metres: convex polygons that tile what is visible"""
    piece_count: IntArray
    """(m,) corners of each"""
    factor: FloatArray
    """(s,) form factor of the part above the horizon"""
    visible_factor: FloatArray
    """(s,) of what is visible of it"""
    hidden: FloatArray
    """(s,) share of its area that is hidden"""

    def __len__(self) -> int:
        return len(self.patch)

    def source(self, k: int) -> Points:
        """The part of source k above the horizon, (n, 3)."""
        return self.corners[k, : self.corner_count[k]]

    def visible(self, k: int) -> list[Points]:
        """What is visible of source k, each (n, 3)."""
        return [self.pieces[i, : self.piece_count[i]] for i in range(self.first[k], self.first[k + 1])]


def backproject(
    surfaces: Surfaces, hierarchy: Hierarchy, position: Vector, normal: Vector, asked: IntArray
) -> Backprojection:
    """What a point (3,) with a unit normal (3,) sees of the patches `asked` (k,), past all in `hierarchy`."""
    position, normal = np.asarray(position, dtype=np.float64), np.asarray(normal, dtype=np.float64)
    h, size, patches = hierarchy, surfaces.size, surfaces.patch_count
    elements, light = _undivided(surfaces), _of_equal_light(patches, asked)
    sources = np.empty(patches, dtype=np.int32)
    corners = np.zeros((patches, ROOM, 3))
    corner_count = np.empty(patches, dtype=np.int32)
    first = np.zeros(patches + 1, dtype=np.int64)
    factors = np.empty((patches, 2))
    room = _PIECES
    while True:
        pieces = np.zeros((room, ROOM, 3))
        piece_count = np.zeros(room, dtype=np.int32)
        s = _backproject(
            position, normal, h.low, h.high, h.skip, h.first, h.count, h.order, elements, light,
            tolerances.SIDE * size, ON_SURFACE * size, ON_PLANE * size, sources, corners, corner_count,
            factors, first, pieces, piece_count,
        )  # fmt: skip
        used = int(first[s])
        if used <= room:
            break
        room = used
    owner = np.repeat(np.arange(s), np.diff(first[: s + 1]))
    whole = _areas(corners[:s], corner_count[:s])
    seen = np.bincount(owner, _areas(pieces[:used], piece_count[:used]), s)
    return Backprojection(
        patch=sources[:s].copy(),
        corners=corners[:s] + position,
        corner_count=corner_count[:s].copy(),
        first=first[: s + 1].copy(),
        pieces=pieces[:used] + position,
        piece_count=piece_count[:used].copy(),
        factor=factors[:s, 0].copy(),
        visible_factor=factors[:s, 1].copy(),
        hidden=np.clip(1.0 - seen / whole, 0.0, 1.0),
    )


def _undivided(surfaces: Surfaces) -> Elements:
    """Patches as elements, for a walk that enters none and weighs none."""
    n = surfaces.patch_count
    obstacles = find_obstacles(surfaces)
    none, number = np.full(n, -1, dtype=np.int32), np.arange(n, dtype=np.int32)
    return Elements(
        none, none, surfaces.corners, surfaces.corner_count, number, np.empty((0, 3)), np.empty((0, 2, 3)),
        surfaces.normal, obstacles.solid, obstacles.bounds,
    )  # fmt: skip


def _of_equal_light(patches: int, shining: IntArray) -> Light:
    luminance, nothing = np.zeros(patches), np.empty(0)
    luminance[shining] = 1.0
    return Light(np.empty((0, 3, 1)), luminance, nothing, nothing, nothing)


def _areas(polygons: FloatArray, count: IntArray) -> FloatArray:
    """m2 of convex polygons (n, ROOM, 3) of so many corners (n,)."""
    spokes = polygons - polygons[:, :1]
    spokes[np.arange(ROOM) >= count[:, None]] = 0.0
    return np.asarray(0.5 * np.linalg.norm(np.cross(spokes[:, :-1], spokes[:, 1:]).sum(axis=1), axis=1))


@kernel
def _backproject(
    x: FloatArray,
    normal: FloatArray,
    low: FloatArray,
    high: FloatArray,
    skip: IntArray,
    leaf_first: IntArray,
    leaf_count: IntArray,
    order: IntArray,
    elements: Elements,
    light: Light,
    side_tolerance: float,
    blocker_tolerance: float,
    source_tolerance: float,
    sources: IntArray,
    corners: FloatArray,
    corner_count: IntArray,
    factors: FloatArray,
    first: Int64Array,
    pieces: FloatArray,
    piece_count: IntArray,
) -> int:
    """Fill in what `Backprojection` has, relative to the point; returns the number of sources.

    Tolerances as in `gather_anywhere`. Pieces are counted in `first` also where there is no room for them.
    """
    patches = len(elements.normals)
    desk = make_desk(len(order))
    buffers = desk.buffers
    work = buffers.work
    sight = make_sight(
        elements.corners[:patches], elements.corner_count[:patches], elements.normals, elements.solid,
        elements.bounds,
    )  # fmt: skip
    planes = np.empty((PLANES, 4))
    found, _ = seen_sources(x, normal, elements, light, source_tolerance, desk, sources, np.empty(patches))
    for k in range(found):
        p = sources[k]
        sides = elements.corner_count[p]
        number = point_shaft(x, normal, elements.corners, sides, elements.normals, p, desk.pyramid, planes)
        near = walk_hierarchy(
            low, high, skip, leaf_first, leaf_count, order, planes, number, side_tolerance, desk.pool
        )
        relative_polygon(x, elements.corners, p, sides, work, WHOLE)
        count = clip_above(work, buffers.stack, sides, normal)
        for corner in range(count):
            for axis in range(3):
                corners[k, corner, axis] = work[ABOVE, corner, axis]
        corner_count[k] = count
        factors[k, 0] = factor_of(work, ABOVE, count, normal)
        kept = cull(
            x, 0, normal, work, ABOVE, count, desk.pyramid, 0, sides, desk.pool, 0, near, sight.corners,
            sight.sides, sight.normals, sight.pyramids, sight.cones, sight.spheres, sight.seen, sight.raised,
            sight.solid, sight.bounds, blocker_tolerance, desk.pool, near,
        )  # fmt: skip
        factors[k, 1] = 0.0
        visible = 0
        if kept != HIDDEN:
            used = min(first[k], len(pieces))
            factors[k, 1], visible = clip_by_pyramids(
                normal, count, desk.pool, near, near + kept, sight.pyramids, sight.sides, blocker_tolerance,
                buffers.stack, buffers.corners, buffers.blocker, work, pieces[used:], piece_count[used:],
            )  # fmt: skip
        first[k + 1] = first[k] + visible
    return found
