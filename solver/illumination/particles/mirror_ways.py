"""Rays that go on at perfect mirrors: where they end, and what mirrors leave of what they show.

Visible specular objects are ray-traced, as [K 4.2] proposes: rays cost only where mirrors are seen, and
planar mirrors are no special case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.types import BoolArray, FloatArray, Int64Array, IntArray, Points
from solver.visibility.rays import RayScene

DIMMEST: Final = 2.0**-10
"""What mirrors leave less than this of, in every channel, is not followed further."""

MOST_MIRRORS: Final = 64
"""Mirrors in a row, at most: only reflectances above 0.9 get so far."""


@dataclass(frozen=True, eq=False)
class Ends:
    """What rays come upon: k points that are not mirrors, or more than that; those of few mirrors first."""

    row: Int64Array
    """(k,) index of the ray"""
    position: Points
    """(k, 3) metres"""
    patch: IntArray
    """(k,)"""
    along: FloatArray
    """(k, 3) direction in which the ray arrives, as long as it was sent off"""
    distance: FloatArray
    """(k,) length of the way, in lengths of the direction"""
    weight: FloatArray
    """(k, 3) what the mirrors on the way leave of its light"""
    depth: IntArray
    """(k,) number of mirrors on the way"""

    def take(self, rows: Int64Array) -> Ends:
        """Those with the indices `rows`."""
        return Ends(*(getattr(self, name)[rows] for name in _FIELDS))


def is_mirror(surfaces: Surfaces, patch: IntArray) -> BoolArray:
    """Whether patches (n,) are perfect mirrors."""
    return np.asarray(np.isinf(surfaces.exponent[patch]) & surfaces.specular[patch].any(axis=1))


def has_mirrors(surfaces: Surfaces) -> bool:
    """Whether any patch is a perfect mirror."""
    return bool(np.any(np.isinf(surfaces.exponent) & surfaces.specular.any(axis=1)))


def is_glossy(surfaces: Surfaces, patch: IntArray) -> BoolArray:
    """Whether patches (n,) reflect by lobes."""
    return np.asarray(np.isfinite(surfaces.exponent[patch]) & surfaces.specular[patch].any(axis=1))


def mirrored(direction: FloatArray, normal: FloatArray) -> FloatArray:
    """Directions (n, 3) after mirrors of unit normals (n, 3)."""
    return np.asarray(direction - 2.0 * np.einsum("na,na->n", direction, normal)[:, None] * normal)


def follow(
    surfaces: Surfaces,
    rays: RayScene,
    start: Points,
    directions: FloatArray,
    reach: float = np.inf,
    weight: FloatArray | None = None,
) -> Ends:
    """Follow rays from `start` (n, 3), off its surface, along `directions` (n, 3), no farther than `reach`.

    `weight` (n, 3) is what mirrors have left of them before.
    """
    row = np.arange(len(start), dtype=np.int64)
    along, travelled = directions, np.zeros(len(start))
    left = np.ones((len(start), 3)) if weight is None else weight
    parts: list[Ends] = []
    for depth in range(MOST_MIRRORS + 1):
        hits = rays.intersect(start, along, reach)
        found = np.flatnonzero(hits.triangle >= 0)
        triangle = hits.triangle[found]
        falling = np.einsum("na,na->n", along[found], surfaces.normal[surfaces.triangle_patch[triangle, 0]])
        patch = np.where(
            falling < 0.0, surfaces.triangle_patch[triangle, 0], surfaces.triangle_patch[triangle, 1]
        )
        # Backs are black.
        lit = patch >= 0
        found, patch = found[lit], patch[lit]
        row, along, left = row[found], along[found], left[found]
        place = start[found] + along * hits.distance[found, None]
        travelled = travelled[found] + hits.distance[found]
        mirrors = is_mirror(surfaces, patch)
        shown = ~mirrors | surfaces.reflectance[patch].any(axis=1) | surfaces.emission[patch].any(axis=1)
        shown &= travelled <= reach
        reached = np.full(len(row), depth, dtype=np.int32)
        parts.append(Ends(*(field[shown] for field in (row, place, patch, along, travelled, left, reached))))
        left = left * surfaces.specular[patch]
        going = np.flatnonzero(mirrors & (left.max(axis=1) >= DIMMEST) & (travelled < reach))
        if len(going) == 0:
            break
        normal = surfaces.normal[patch[going]]
        row, left, travelled = row[going], left[going], travelled[going]
        along = mirrored(along[going], normal)
        start = place[going] + (rays.offset / rays.scale) * normal
    if len(parts) == 1:
        return parts[0]
    return Ends(*(np.concatenate([getattr(part, name) for part in parts]) for name in _FIELDS))


_FIELDS: Final = ("row", "position", "patch", "along", "distance", "weight", "depth")
