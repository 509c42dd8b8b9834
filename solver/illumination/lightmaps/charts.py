"""Charts: planar pieces of surface, each with a rectangle of its own plane around it.

A face's patches that lie in one plane are one chart, so that light is interpolated across the lines along
which a concave face was cut; all others are charts by themselves. A chart is seen from its front, by an
isometry of its plane: nothing is stretched, and two places of a chart that coincide are one place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.surfaces import Surfaces
from solver.types import BoolArray, FloatArray, IntArray, Points

_CANDIDATES: Final = 8
"""Edges of a chart, the longest first, that its rectangle may lie along."""


@dataclass(frozen=True, eq=False)
class Charts:
    """k charts of p patches."""

    of_patch: IntArray
    """(p,) chart that a patch belongs to"""
    origin: Points
    """(k, 3) metres: the upper left corner of a chart's rectangle"""
    axes: FloatArray
    """(k, 2, 3) unit vectors to the right and downwards, for whoever looks at the front"""
    extent: FloatArray
    """(k, 2) metres: width and height of the rectangle"""

    def __len__(self) -> int:
        return len(self.origin)

    def places(self, points: FloatArray, patch: IntArray) -> FloatArray:
        """(n, m, 2) metres from the origin of the charts of patches (n,), of points (n, m, 3) on them."""
        chart = self.of_patch[patch]
        return np.asarray(np.einsum("nka,nma->nmk", self.axes[chart], points - self.origin[chart, None]))


def charts_of(surfaces: Surfaces) -> Charts:
    """The charts of all patches."""
    of_patch = _grouped(surfaces)
    count = int(of_patch.max(initial=-1)) + 1
    _, first = np.unique(of_patch, return_index=True)
    normal = surfaces.normal[first]
    corners = surfaces.corners.reshape(-1, 3)
    chart = np.repeat(of_patch, 4)
    best = np.full(count, np.inf)
    axes, low, extent = np.zeros((count, 2, 3)), np.zeros((count, 2)), np.zeros((count, 2))
    center = surfaces.center
    for right in _directions(surfaces, of_patch, count):
        turned = np.stack([right, np.cross(right, normal)], axis=1)
        place = np.einsum("nka,na->nk", turned[chart], corners - center)
        least, most = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        np.minimum.at(least, chart, place)
        np.maximum.at(most, chart, place)
        size = most - least
        better = size.prod(axis=1) < best
        best[better] = size[better].prod(axis=1)
        axes[better], low[better], extent[better] = turned[better], least[better], size[better]
    # Back from places in the plane to points of it: those have the plane's height over the centre.
    height = np.einsum("ka,ka->k", normal, surfaces.corners[first, 0] - center)
    origin = center + np.einsum("kn,kna->ka", low, axes) + height[:, None] * normal
    return Charts(of_patch, origin, axes, extent)


def _grouped(surfaces: Surfaces) -> IntArray:
    """Chart (p,) of each patch."""
    face = np.stack([surfaces.object, surfaces.face, surfaces.side], axis=1)
    _, number = np.unique(face, axis=0, return_inverse=True)
    group = number.reshape(-1).astype(np.int32)
    apart = _bent(surfaces, group)[group]
    # A patch of a bent face is told from the others by its own number.
    alone = np.where(apart, np.arange(surfaces.patch_count), -1)
    _, chart = np.unique(np.stack([group, alone], axis=1), axis=0, return_inverse=True)
    return chart.reshape(-1).astype(np.int32)


def _bent(surfaces: Surfaces, group: IntArray) -> BoolArray:
    """Whether the patches of each group leave the plane of its first one, or face another way."""
    count = int(group.max(initial=-1)) + 1
    _, first = np.unique(group, return_index=True)
    normal, start = surfaces.normal[first][group], surfaces.corners[first, 0][group]
    away = surfaces.corners - start[:, None]
    height, apart = np.zeros(count), np.zeros(count)
    np.maximum.at(height, group, np.abs(np.einsum("pka,pa->pk", away, normal)).max(axis=1))
    np.maximum.at(apart, group, np.linalg.norm(away, axis=2).max(axis=1))
    turned = np.zeros(count, dtype=np.bool_)
    turned[group[np.einsum("pa,pa->p", surfaces.normal, normal) <= 0.0]] = True
    return np.asarray(turned | (height > tolerances.PLANARITY * apart))


def _directions(surfaces: Surfaces, of_patch: IntArray, count: int) -> list[FloatArray]:
    """Unit directions (k, 3) of the longest edges of all charts, the next longest, and so on."""
    corners = surfaces.corners
    triangle = surfaces.corner_count == 3
    edges = np.roll(corners, -1, axis=1) - corners
    edges[triangle, 2] = corners[triangle, 0] - corners[triangle, 2]
    edges[triangle, 3] = 0.0
    edges = edges.reshape(-1, 3)
    length = np.linalg.norm(edges, axis=1)
    chart = np.repeat(of_patch, 4)
    order = np.lexsort((-length, chart))
    start = np.searchsorted(chart[order], np.arange(count))
    number = np.bincount(chart[length > 0.0], minlength=count)
    _, first = np.unique(of_patch, return_index=True)
    normal = surfaces.normal[first]
    found = []
    for rank in range(min(_CANDIDATES, int(number.max(initial=0)))):
        chosen = order[start + np.minimum(rank, number - 1)]
        # In the plane of the chart to rounding, whichever patch the edge is of.
        along = edges[chosen] - np.einsum("ka,ka->k", edges[chosen], normal)[:, None] * normal
        found.append(np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True)))
    return found
