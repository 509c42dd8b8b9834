"""Charts packed into one picture, by their shapes, with xatlas.

Charts are not turned and not scaled: each comes with its corners in texels, a whole number of them across
and down, so that the outermost texels of a rectangle have their centres on its edges.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

import numpy as np
import xatlas

from solver.types import FloatArray, Int64Array, IntArray

PADDING: Final = 2
"""Texels between those of two charts that are looked at."""

PAGE: Final = 4096
"""Charts packed at once, in a quarter of a second: the time grows by the square of their number."""


def pack(
    corners: FloatArray, corner_count: IntArray, extent: Int64Array
) -> Generator[None, None, tuple[Int64Array, tuple[int, int]]]:
    """Where convex charts (k, 4, 2) in texels from 0 up to their `extent` (k, 2) go, in steps.

    Returns the texels (k, 2), column and row, whose centres are the charts' zeros, and the picture's width
    and height. Sizes being equal, so are the places.
    """
    # Pages of charts of like size, which are then packed as charts themselves.
    order = np.argsort(-extent.sum(axis=1), kind="stable")
    place = np.zeros_like(extent)
    pages = [order[first : first + PAGE] for first in range(0, len(order), PAGE)]
    sizes = np.zeros((len(pages), 2), dtype=np.int64)
    for number, page in enumerate(pages):
        place[page], sizes[number] = _packed(corners[page], corner_count[page])
        yield
    if len(pages) == 0:
        return place, (1, 1)
    if len(pages) == 1:
        return place, (int(sizes[0, 0]), int(sizes[0, 1]))
    last = sizes - 1
    rectangles = np.zeros((len(pages), 4, 2))
    rectangles[:, 1:3, 0] = last[:, :1]
    rectangles[:, 2:, 1] = last[:, 1:]
    shift, size = _packed(rectangles, np.full(len(pages), 4, dtype=np.int32))
    for page, moved in zip(pages, shift, strict=True):
        place[page] += moved
    return place, (int(size[0]), int(size[1]))


def _packed(corners: FloatArray, corner_count: IntArray) -> tuple[Int64Array, Int64Array]:
    """Texel (k, 2) of each chart's zero, and the size (2,) of the picture that holds all of them."""
    count = len(corners)
    base = 4 * np.arange(count)[:, None, None]
    pieces = base + np.array([[0, 1, 2], [0, 2, 3]])
    there = np.arange(2) < (corner_count - 2)[:, None]
    material = np.repeat(np.arange(count), there.sum(axis=1))
    atlas = xatlas.Atlas()
    # Of different material, or charts that lie upon each other would be one.
    atlas.add_uv_mesh(
        corners.reshape(-1, 2).astype(np.float32),
        pieces[there].astype(np.uint32),
        material.astype(np.uint32)[:, None],
    )
    options = xatlas.PackOptions()
    options.texels_per_unit = 1.0
    options.padding = PADDING
    options.bilinear = True
    options.rotate_charts = False
    options.rotate_charts_to_axis = False
    atlas.generate(pack_options=options)
    vertex, _, uv = atlas[0]
    size = np.array([atlas.width, atlas.height])
    # The centre of texel (i, j) is at (i + 1/2, j + 1/2).
    moved = np.rint(uv * size - corners.reshape(-1, 2)[vertex] - 0.5).astype(np.int64)
    place = np.zeros((count, 2), dtype=np.int64)
    first = vertex % 4 == 0  # a triangle's fourth corner is in no piece, and has gone nowhere
    place[vertex[first] // 4] = moved[first]
    return place, size.astype(np.int64)
