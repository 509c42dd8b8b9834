"""Light for texels that have none of their own, from their neighbours: against bleeding.

Smaller versions of a picture, and filters wider than four texels, look at texels between charts. And places
that lie inside of solid things, where a box stands on a floor, are dark, and would darken what is around it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.hemisphere import tangent_frames
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.types import BoolArray, Float32Array, IntArray, Points
from solver.visibility.rays import RayScene

RINGS: Final = 4
"""Rings of texels that are filled around those with light of their own."""

_RAYS: Final = 16
"""Rays by which a place is found to be inside of something."""

_GOLDEN: Final = float(np.pi * (3.0 - np.sqrt(5.0)))
_ROWS: Final = 64
_AT_ONCE: Final = 1 << 16


def buried(positions: Points, patch: IntArray, surfaces: Surfaces, rays: RayScene) -> BoolArray:
    """Which points (n, 3) on `patch` (n,) see nothing but the black backs of surfaces, all around."""
    inside = np.ones(len(patch), dtype=np.bool_)
    for turn in range(_RAYS):
        # Those that have seen something else are not asked again.
        left = np.flatnonzero(inside)
        for first in range(0, len(left), _AT_ONCE):
            part = left[first : first + _AT_ONCE]
            normal = surfaces.normal[patch[part]]
            tangent, other = tangent_frames(normal)
            height = (turn + 0.5) / _RAYS
            radius = np.sqrt(1.0 - height * height)
            along = radius * (np.cos(turn * _GOLDEN) * tangent + np.sin(turn * _GOLDEN) * other)
            directions = along + height * normal
            start = positions[part] + (rays.offset / rays.scale) * normal
            triangle = rays.intersect(start, directions).triangle
            met = surfaces.triangle_patch[triangle]
            front = surfaces.normal[met[:, 0]]
            back = np.einsum("na,na->n", directions, front) >= 0.0
            inside[part] = (triangle >= 0) & back & (met[:, 1] < 0)
    return inside


def fill(image: Float32Array, known: BoolArray, chart: IntArray, rings: int = RINGS) -> None:
    """Fill texels of `image` (h, w, 3) that are not `known` (h, w), ring by ring, with means of neighbours.

    A texel of a `chart` (h, w) is filled from its own chart alone. What is farther away stays as it is.
    """
    for _ in range(rings):
        _fill_ring(image, known, chart)


def _fill_ring(image: Float32Array, known: BoolArray, chart: IntArray) -> None:
    before, had = image.copy(), known.copy()
    run_chunks(lambda start, stop: _ring(start, stop, before, had, chart, image, known), len(image), _ROWS)


@kernel
def _ring(
    start: int,
    stop: int,
    before: Float32Array,
    had: BoolArray,
    chart: IntArray,
    image: Float32Array,
    known: BoolArray,
) -> None:
    height, width = had.shape
    for row in range(start, stop):
        for column in range(width):
            if had[row, column]:
                continue
            own = chart[row, column]
            count = 0
            red = green = blue = np.float32(0.0)
            for r in range(max(0, row - 1), min(height, row + 2)):
                for c in range(max(0, column - 1), min(width, column + 2)):
                    if had[r, c] and (own < 0 or chart[r, c] == own):
                        red += before[r, c, 0]
                        green += before[r, c, 1]
                        blue += before[r, c, 2]
                        count += 1
            if count > 0:
                known[row, column] = True
                image[row, column, 0] = red / count
                image[row, column, 1] = green / count
                image[row, column, 2] = blue / count
