"""The texels of an atlas that are looked at, and the point of a surface that each of them stands for.

A look at any place of a patch is interpolated from four texels. All of these have light: a texel whose
centre lies off its chart takes that of the nearest place on it. Points are moved
a sixteenth of a texel off the edges of their patches, where other surfaces may touch, so that each is on the
side that it is meant for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.lightmaps.atlas import ROUNDING, Atlas
from solver.kernels import inline_kernel, kernel
from solver.types import Float32Array, FloatArray, IntArray, Points

TILE: Final = 16
"""Texels along a side of a tile, whose points follow one another."""

_INSET: Final = 1.0 / 16.0
"""Texels towards the middle of a patch."""

_MOST_INSET: Final = 0.25
"""Of the way to the middle, where a patch is smaller than a texel."""

_REACH: Final = 2.0
"""Squared texels from a patch, within which a centre is one of the four around a place on the patch."""


@dataclass(frozen=True, eq=False)
class Texels:
    """n texels of a picture."""

    pixel: IntArray
    """(n,) row by row from the upper left"""
    patch: IntArray
    """(n,)"""
    position: Points
    """(n, 3) metres"""
    chart: IntArray
    """(height, width) chart that a texel belongs to; -1 for none"""

    def __len__(self) -> int:
        return len(self.pixel)


def texels_of(atlas: Atlas, surfaces: Surfaces) -> Texels:
    """All texels of `atlas` that stand for a place, in tiles, chart by chart."""
    corners = atlas.texels_at(surfaces.corners, np.arange(surfaces.patch_count, dtype=np.int32))
    patch = np.full((atlas.height, atlas.width), -1, dtype=np.int32)
    apart = np.full((atlas.height, atlas.width), _REACH, dtype=np.float32)
    _cover(corners, surfaces.corner_count, apart, patch)
    chart = np.append(atlas.charts.of_patch, np.int32(-1))[patch]  # where there is no patch, the last one
    row, column = np.nonzero(patch >= 0)
    across = -(-atlas.width // TILE)
    tile = (row // TILE) * across + column // TILE
    tiles = across * -(-atlas.height // TILE)
    key = ((chart[row, column].astype(np.int64) * tiles + tile) * TILE + row % TILE) * TILE + column % TILE
    order = np.argsort(key, kind="stable")
    row, column = row[order], column[order]
    found = patch[row, column]
    place = np.stack([column, row], axis=1).astype(np.float64)
    _settle(corners, surfaces.corner_count, found, place)
    pixel = (row * atlas.width + column).astype(np.int32)
    return Texels(pixel, found, atlas.points_at(place, found), chart)


@kernel
def _cover(corners: FloatArray, corner_count: IntArray, apart: Float32Array, patch: IntArray) -> None:
    """Give each texel the nearest patch within `apart` (h, w), and leave the squared distance there."""
    height, width = patch.shape
    reach = 1.0 - ROUNDING
    for p in range(len(corners)):
        n = corner_count[p]
        left, right = corners[p, 0, 0], corners[p, 0, 0]
        top, bottom = corners[p, 0, 1], corners[p, 0, 1]
        for k in range(1, n):
            left, right = min(left, corners[p, k, 0]), max(right, corners[p, k, 0])
            top, bottom = min(top, corners[p, k, 1]), max(bottom, corners[p, k, 1])
        for row in range(max(0, int(np.ceil(top - reach))), min(height, int(np.floor(bottom + reach)) + 1)):
            for column in range(
                max(0, int(np.ceil(left - reach))), min(width, int(np.floor(right + reach)) + 1)
            ):
                x, y = _nearest(corners[p], n, float(column), float(row))
                square = (x - column) ** 2 + (y - row) ** 2
                if square < apart[row, column]:
                    apart[row, column] = square
                    patch[row, column] = p


@kernel
def _settle(corners: FloatArray, corner_count: IntArray, patch: IntArray, place: FloatArray) -> None:
    """Move places (n, 2) on to their patches (n,), and off the edges, towards the middle."""
    for i in range(len(patch)):
        p = patch[i]
        n = corner_count[p]
        x, y = _nearest(corners[p], n, place[i, 0], place[i, 1])
        if _depth(corners[p], n, x, y) < _INSET:
            mx = my = 0.0
            for k in range(n):
                mx += corners[p, k, 0] / n
                my += corners[p, k, 1] / n
            away = np.sqrt((mx - x) ** 2 + (my - y) ** 2)
            share = min(_MOST_INSET, _INSET / max(away, 1e-9))
            x, y = x + share * (mx - x), y + share * (my - y)
        place[i, 0], place[i, 1] = x, y


@inline_kernel
def _depth(corners: FloatArray, n: int, x: float, y: float) -> float:
    """From a place in a convex polygon (n, 2) to the nearest line through an edge."""
    least = np.inf
    for k in range(n):
        following = k + 1 if k + 1 < n else 0
        ex, ey = corners[following, 0] - corners[k, 0], corners[following, 1] - corners[k, 1]
        length = np.sqrt(ex * ex + ey * ey)
        if length > 0.0:
            least = min(least, abs(ex * (y - corners[k, 1]) - ey * (x - corners[k, 0])) / length)
    return least


@inline_kernel
def _nearest(corners: FloatArray, n: int, x: float, y: float) -> tuple[float, float]:
    """The place nearest to (x, y) in a convex polygon (n, 2)."""
    left = right = False
    best = np.inf
    bx, by = x, y
    for k in range(n):
        following = k + 1 if k + 1 < n else 0
        ax, ay = corners[k, 0], corners[k, 1]
        ex, ey = corners[following, 0] - ax, corners[following, 1] - ay
        side = ex * (y - ay) - ey * (x - ax)
        left = left or side > 0.0
        right = right or side < 0.0
        square = ex * ex + ey * ey
        along = ((x - ax) * ex + (y - ay) * ey) / square if square > 0.0 else 0.0
        along = min(max(along, 0.0), 1.0)
        px, py = ax + along * ex, ay + along * ey
        apart = (px - x) ** 2 + (py - y) ** 2
        if apart < best:
            best = apart
            bx, by = px, py
    # On one side of all edges: inside, whichever way round they go.
    if not (left and right):
        return x, y
    return bx, by
