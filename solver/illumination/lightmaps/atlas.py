"""The layout of a lightmap: which texel holds the light of which place.

Charts get a whole number of texels across and down, never fewer than the density asks for, so that the
rectangle's edges run through centres of texels: light at an edge is a texel's own, and is not interpolated
with what lies beyond.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.errors import SceneError
from solver.geometry.surfaces import Surfaces
from solver.illumination.lightmaps.charts import Charts, charts_of
from solver.illumination.lightmaps.packing import pack
from solver.types import FloatArray, Int64Array, IntArray

DEFAULT_TEXELS: Final = 2**18
"""About so many texels lie on surfaces where no density is given."""

MOST_SIDE: Final = 8192
"""Texels of a chart across or down: more than that, pictures of it are shown nowhere."""


ROUNDING: Final = 1e-6
"""Texels by which a length that is a whole number of them may be above it."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """A picture in which each of k charts has its place."""

    width: int
    height: int
    density: float
    """Texels per metre, of the charts at least"""
    charts: Charts
    scale: FloatArray
    """(k, 2) texels per metre, across and down"""
    place: Int64Array
    """(k, 2) column and row of the texel whose centre is the chart's origin"""

    def texels_at(self, points: FloatArray, patch: IntArray) -> FloatArray:
        """(n, m, 2) columns and rows of points (n, m, 3) on patches (n,); whole at centres of texels."""
        chart = self.charts.of_patch[patch]
        places = self.charts.places(points, patch) * self.scale[chart, None]
        return np.asarray(places + self.place[chart, None])

    def coordinates(self, points: FloatArray, patch: IntArray) -> FloatArray:
        """(n, m, 2) texture coordinates: 0 to 1, from the upper left corner of the picture."""
        return np.asarray(
            (self.texels_at(points, patch) + 0.5) / np.array([self.width, self.height], dtype=np.float64)
        )

    def points_at(self, texels: FloatArray, patch: IntArray) -> FloatArray:
        """(n, 3) metres: points in the planes of patches (n,) at columns and rows (n, 2)."""
        chart = self.charts.of_patch[patch]
        places = (texels - self.place[chart]) / self.scale[chart]
        return np.asarray(
            self.charts.origin[chart] + np.einsum("nk,nka->na", places, self.charts.axes[chart])
        )


def lay_out(surfaces: Surfaces, density: float | None, most_texels: int) -> Generator[None, None, Atlas]:
    """The atlas of `surfaces` with `density` texels per metre, in steps; None chooses one.

    Raises SceneError naming the density where the picture would have more than `most_texels`.
    """
    area = float(surfaces.area.sum())
    chosen = density or (float(np.sqrt(min(DEFAULT_TEXELS, most_texels / 4) / area)) if area > 0.0 else 1.0)
    charts = charts_of(surfaces)
    yield
    wanted = np.maximum(np.ceil(chosen * charts.extent - ROUNDING), 1.0)
    least = float((0.5 * wanted.prod(axis=1)).sum())
    if least > most_texels or wanted.max(initial=0.0) >= MOST_SIDE:
        raise _too_dense(chosen, least, most_texels)
    scale = wanted / np.maximum(charts.extent, 1e-300)
    corners, count = _outlines(surfaces, charts, scale, wanted)
    place, (width, height) = yield from pack(corners, count, wanted.astype(np.int64))
    if width * height > most_texels:
        raise _too_dense(chosen, width * height, most_texels)
    return Atlas(width, height, chosen, charts, scale, place)


def _too_dense(density: float, texels: float, most: int) -> SceneError:
    return SceneError(
        f"{density:.6g} texels per metre make over {texels:.3g} texels in all, of {most:,} that a picture "
        f"may have, or {MOST_SIDE:,} across a face: ask for fewer",
        ("density",),
    )


def _outlines(
    surfaces: Surfaces, charts: Charts, scale: FloatArray, wanted: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Convex outlines (k, 4, 2) of charts in texels, and their corners (k,): the patch, or the rectangle."""
    count = len(charts)
    outline = np.zeros((count, 4, 2))
    outline[:, 1:3, 0] = wanted[:, :1]
    outline[:, 2:, 1] = wanted[:, 1:]
    corners = np.full(count, 4, dtype=np.int32)
    single = np.bincount(charts.of_patch, minlength=count)[charts.of_patch] == 1
    alone = np.flatnonzero(single).astype(np.int32)
    chart = charts.of_patch[alone]
    outline[chart] = charts.places(surfaces.corners[alone], alone) * scale[chart, None]
    corners[chart] = surfaces.corner_count[alone]
    return outline, corners
