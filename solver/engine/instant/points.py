"""The points that light up a frame: those that its pixels show, and those that they show by mirrors.

A pixel has its point, and where that is on a mirror the ends of the mirrored ray as well, each with what the
mirrors leave of its light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.engine.world import World
from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.glossy import gloss_of, is_broad, lobe_axis, lobe_factor
from solver.illumination.particles.light_lobes import Gloss
from solver.illumination.particles.mirror_ways import follow, is_glossy, is_mirror, mirrored
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.rendering.surface_points import SurfacePoints
from solver.types import BoolArray, Float32Array, FloatArray, Int64Array, IntArray, Points, Vector

_SAME: Final = 1e-9
"""Points nearer than this times the scene's size are the same."""

_ALL: Final = slice(None)


@dataclass(frozen=True, eq=False)
class LitPoints:
    """n points of a sample of each pixel: those that pixels show, then those by one mirror, by two, ..."""

    pixel: IntArray
    """(n,) row by row from the top left"""
    depth: IntArray
    """(n,) mirrors between the eye and the point; a pixel has one point of each depth at most"""
    patch: IntArray
    """(n,)"""
    position: Points
    """(n, 3) metres"""
    eye: Vector
    """(3,) metres"""
    shown: int
    """Number of points that pixels show themselves"""
    arrival: FloatArray
    """(n - shown, 3) unit direction in which the eye's ray arrives at those by mirrors"""
    left: FloatArray
    """(n - shown, 3) what the mirrors leave of their light"""

    @classmethod
    def of(cls, points: SurfacePoints, camera: Camera, world: World) -> LitPoints:
        """Where the rays of `camera` to `points` end."""
        surfaces, n = world.surfaces, len(points)
        depth: IntArray = np.zeros(n, dtype=np.int32)
        none = np.empty((0, 3))
        alone = cls(points.pixel, depth, points.patch, points.position, camera.eye, n, none, none)
        seen = _of_those(is_mirror, surfaces, points.patch)
        if len(seen) == 0:
            return alone
        patch = points.patch[seen]
        normal = surfaces.normal[patch]
        start = points.position[seen] + (world.rays.offset / world.rays.scale) * normal
        along = mirrored(alone.along(seen), normal)
        ends = follow(surfaces, world.rays, start, along, weight=surfaces.specular[patch])
        return cls(
            np.concatenate([points.pixel, points.pixel[seen[ends.row]]]),
            np.concatenate([depth, ends.depth + np.int32(1)]),
            np.concatenate([points.patch, ends.patch]).astype(np.int32),
            np.concatenate([points.position, ends.position]),
            camera.eye,
            n,
            ends.along,
            ends.weight,
        )

    def __len__(self) -> int:
        return len(self.pixel)

    def along(self, rows: Int64Array) -> FloatArray:
        """Unit directions (k, 3) in which the eye's rays arrive at the points `rows` (k,)."""
        along = self.position[rows] - self.eye
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        by_mirrors = np.flatnonzero(rows >= self.shown)
        along[by_mirrors] = self.arrival[rows[by_mirrors] - self.shown]
        return np.asarray(along)

    def weight(self, rows: Int64Array) -> FloatArray:
        """What mirrors leave (k, 3) of the light of the points `rows` (k,)."""
        weight = np.ones((len(rows), 3))
        by_mirrors = np.flatnonzero(rows >= self.shown)
        weight[by_mirrors] = self.left[rows[by_mirrors] - self.shown]
        return weight

    def keys(self, pixels: int, rows: IntArray | Int64Array | slice = _ALL) -> Int64Array:
        """Numbers by which points are known, all (n,) or some, of a frame of so many pixels."""
        return np.asarray(self.depth[rows].astype(np.int64) * pixels + self.pixel[rows])


def _of_those(
    which: Callable[[Surfaces, IntArray], BoolArray], surfaces: Surfaces, patch: IntArray
) -> Int64Array:
    """Which points on patches (n,) are on those that `which` tells of."""
    chosen = which(surfaces, np.arange(surfaces.patch_count, dtype=np.int32))
    return np.flatnonzero(chosen[patch]) if chosen.any() else np.empty(0, dtype=np.int64)


def matched(
    points: LitPoints, before: LitPoints, world: World, world_before: World, pixels: int
) -> tuple[Int64Array, BoolArray]:
    """Which of the points `before` `points` may be (n,), and whether they are, seen from there too (n,)."""
    if len(before) == 0:
        return np.zeros(len(points), dtype=np.int64), np.zeros(len(points), dtype=np.bool_)
    theirs, mine = before.keys(pixels), points.keys(pixels)
    order = np.argsort(theirs, kind="stable")
    source = order[np.minimum(np.searchsorted(theirs, mine, sorter=order), len(theirs) - 1)]
    apart = np.abs(points.position - before.position[source]).max(axis=1)
    normal, other = world.surfaces.normal[points.patch], world_before.surfaces.normal[before.patch[source]]
    same = (theirs[source] == mine) & (apart <= _SAME * world.surfaces.size)
    same &= np.abs(normal - other).max(axis=1) <= _SAME
    # By mirrors an eye may see the same point from elsewhere.
    rows = np.flatnonzero(same & (points.depth > 0))
    same[rows] = np.abs(points.along(rows) - before.along(source[rows])).max(axis=1) <= _SAME
    return source, same


@dataclass(frozen=True, eq=False)
class GlossyPoints:
    """Those g of a list of points whose patches reflect by lobes."""

    row: Int64Array
    """(g,) in the list"""
    axis: FloatArray
    """(g, 3) unit, of the lobe towards the eye"""
    broad: Int64Array
    """Which of the g are lit by virtual lights"""
    narrow: Int64Array
    """Which of the g send rays"""
    receivers: Receivers
    """The broad ones"""
    gloss: Gloss
    """Their lobes"""

    @classmethod
    def of(cls, points: LitPoints, world: World, polygons: Polygons) -> GlossyPoints:
        """The glossy ones of `points`."""
        surfaces = world.surfaces
        row = _of_those(is_glossy, surfaces, points.patch)
        patch = points.patch[row]
        axis = lobe_axis(surfaces, patch, points.along(row))
        is_wide = is_broad(surfaces, patch)
        broad, narrow = np.flatnonzero(is_wide), np.flatnonzero(~is_wide)
        return cls(
            row,
            axis,
            broad,
            narrow,
            Receivers.on(polygons, points.position[row[broad]], patch[broad]),
            gloss_of(surfaces, patch[broad], axis[broad]),
        )

    def __len__(self) -> int:
        return len(self.row)

    def add_sampled(
        self, light: Float32Array, rows: IntArray, found: Float32Array, along: FloatArray
    ) -> None:
        """Add to `light` (3, g) of the broad ones among `rows` (k,) irradiance (3, k) from `along` (k, 3)."""
        if len(self.broad) == 0:
            return
        at = np.searchsorted(self.row[self.broad], rows)
        at = np.minimum(at, len(self.broad) - 1)
        chosen = np.flatnonzero(self.row[self.broad[at]] == rows)
        at = at[chosen]
        gloss = Gloss(self.gloss.axis[:, at], self.gloss.exponent[at])
        light[:, self.broad[at]] += found[:, chosen] * lobe_factor(gloss, along[chosen])

    def matched(
        self, later: GlossyPoints, source: Int64Array, same: BoolArray
    ) -> tuple[Int64Array, BoolArray]:
        """Which of these `later` ones are (g,), and which points are then still the same (n,).

        `source` (n,) and `same` (n,) tell it of all points: one is not, whose lobe is of another kind.
        """
        place = np.full(int(source.max(initial=0)) + 1, -1, dtype=np.int64)
        known = self.row < len(place)
        place[self.row[known]] = np.flatnonzero(known)
        found = place[source[later.row]]
        same = same.copy()
        same[later.row] &= found >= 0
        return np.maximum(found, 0), same

    def dark(self) -> Float32Array:
        """No light (3, g)."""
        return np.zeros((3, len(self)), dtype=np.float32)
