"""The points that pixels show, as a list: what a renderer lights that works on points and not on a screen.

Tiles of pixels follow one another, so that points near each other in the list are near each other in space.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.rendering.projection import PixelRays
from solver.types import FloatArray, IntArray, Points, Vector

TILE: Final = 16
"""Pixels along a side of a tile"""

_CHUNK: Final = 1 << 13
"""Points of a piece of work"""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """n points on fronts of patches, one for each pixel that shows one."""

    size: tuple[int, int]
    """Width and height of the frame"""
    pixel: IntArray
    """(n,) row by row from the top left"""
    patch: IntArray
    """(n,)"""
    position: Points
    """(n, 3) metres"""

    def __len__(self) -> int:
        return len(self.pixel)


def surface_points(patch: IntArray, surfaces: Surfaces, eye: Vector, rays: PixelRays) -> SurfacePoints:
    """Where `rays` from `eye` (3,), local, meet the planes of `patch` (h, w), which is -1 for no point.

    A pixel that a patch just touches, seen edge on, can miss its plane: its point is then the patch's middle.
    """
    height, width = patch.shape
    pixel, found = np.empty(height * width, dtype=np.int32), np.empty(height * width, dtype=np.int32)
    n = _list(_tiles(height, width), np.ascontiguousarray(patch).ravel(), pixel, found)
    pixel, found = pixel[:n], found[:n]
    position = np.empty((n, 3))
    corners = (surfaces.corners - surfaces.center) / surfaces.size
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    run_chunks(
        lambda start, stop: _meet(
            start, stop, pixel, found, width, eye, rays, surfaces.normal, middle, radius, surfaces.center,
            surfaces.size, position,
        ),
        n,
        _CHUNK,
    )  # fmt: skip
    return SurfacePoints((width, height), pixel, found, position)


@lru_cache(maxsize=4)
def _tiles(height: int, width: int) -> IntArray:
    """Pixels (h w,), tile by tile; not to be written to."""
    row, column = np.divmod(np.arange(height * width, dtype=np.int64), width)
    across = -(-width // TILE)
    tile = (row // TILE) * across + column // TILE
    key = (tile * TILE + row % TILE) * TILE + column % TILE
    return np.argsort(key, kind="stable").astype(np.int32)


@kernel
def _list(order: IntArray, patch: IntArray, pixel: IntArray, found: IntArray) -> int:
    """Pixels (n,) in that order that show a patch (h w,), and the patches (n,); how many there are."""
    count = 0
    for i in order:
        pixel[count], found[count] = i, patch[i]
        count += patch[i] >= 0
    return count


@kernel
def _meet(
    start: int,
    stop: int,
    pixel: IntArray,
    patch: IntArray,
    width: int,
    eye: Vector,
    rays: PixelRays,
    normal: FloatArray,
    middle: Points,
    radius: FloatArray,
    center: Vector,
    size: float,
    position: Points,
) -> None:
    """World points (n, 3) of the pixels [start, stop)."""
    for i in range(start, stop):
        row = pixel[i] // width
        column = pixel[i] - row * width
        p = patch[i]
        above = 0.0
        falling = 0.0
        for axis in range(3):
            ray = rays.first[axis] + column * rays.across[axis] + row * rays.down[axis]
            above += (eye[axis] - middle[p, axis]) * normal[p, axis]
            falling -= ray * normal[p, axis]
        far = above / falling if falling > 0.0 else 0.0
        apart = 0.0
        for axis in range(3):
            ray = rays.first[axis] + column * rays.across[axis] + row * rays.down[axis]
            position[i, axis] = eye[axis] + far * ray
            apart += (position[i, axis] - middle[p, axis]) ** 2
        if not apart <= 4.0 * radius[p] * radius[p]:
            for axis in range(3):
                position[i, axis] = middle[p, axis]
        for axis in range(3):
            position[i, axis] = center[axis] + size * position[i, axis]
