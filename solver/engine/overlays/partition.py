"""A source as a point sees it: what is hidden, and which lines part it from what is not ([H B.4.10]).

In the source's own plane, in units of its size, so that one grid serves sources of any size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely

from solver.types import BoolArray, FloatArray, IntArray

GRID: Final = 1e-9
"""Places closer than this times the source's size are one: pieces that touch do so within rounding."""

_SLIVER: Final = 1e-9
"""What is smaller than this times the square of the source's size is no piece."""

_BESIDE: Final = 1e-7
"""How far beside a line, relative to the source's size, tells what it parts."""

OUTLINE: Final = 0
"""A part of the source's own border"""
SHADOW: Final = 1
"""Between what is seen and what is hidden: an edge of a blocker, projected back"""
INSERTED: Final = 2
"""Between two visible pieces"""


class Partition(NamedTuple):
    """What is not seen of a source, and all lines on it."""

    hidden: FloatArray
    """(h, 3, 2) triangles, counter-clockwise"""
    lines: FloatArray
    """(l, 2, 2)"""
    kind: IntArray
    """(l,) OUTLINE, SHADOW or INSERTED"""


def part_source(source: FloatArray, visible: Sequence[FloatArray]) -> Partition:
    """Part a convex polygon `source` (k, 2) of which the convex polygons `visible`, each (m, 2), are seen.

    Lengths relative to the source's size.
    """
    whole = shapely.set_precision(shapely.Polygon(source), GRID)
    pieces = shapely.set_precision(np.array([shapely.Polygon(piece) for piece in visible]), GRID)
    seen = shapely.union_all(pieces, grid_size=GRID)
    rest = shapely.difference(whole, seen, grid_size=GRID)
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(rest))
    triangles = triangles[shapely.area(triangles) > _SLIVER]
    borders = shapely.boundary(np.append(pieces, whole))
    lines = _segments(shapely.union_all(borders, grid_size=GRID))
    inside, outside = (_beside(lines, side) for side in (1.0, -1.0))
    both_seen = _holds(seen, inside) & _holds(seen, outside)
    at_border = ~(_holds(whole, inside) & _holds(whole, outside))
    kind = np.select([both_seen, at_border], [INSERTED, OUTLINE], SHADOW).astype(np.int32)
    rings = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)
    return Partition(rings[:, :3].copy(), lines, kind)


def _segments(lines: object) -> FloatArray:
    """(l, 2, 2) the straight parts of linework."""
    places, owner = shapely.get_coordinates(shapely.get_parts(lines), return_index=True)
    joined = owner[1:] == owner[:-1]
    return np.stack([places[:-1][joined], places[1:][joined]], axis=1)


def _beside(lines: FloatArray, side: float) -> FloatArray:
    """(l, 2) points beside the middles of lines, to the left where `side` is 1."""
    along = lines[:, 1] - lines[:, 0]
    left = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(lines.mean(axis=1) + side * _BESIDE * left)


def _holds(area: object, points: FloatArray) -> BoolArray:
    shapely.prepare(area)
    return np.asarray(shapely.contains_xy(area, points))
