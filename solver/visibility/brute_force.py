"""A twin of the ray queries, shafts and visible fractions: slow, plain numpy, float64; the tests' oracle.

Every segment is put to every triangle. A crossing has a margin, the distance in metres by which the
segment's ends may move without changing the answer, about: two methods that round differently may
disagree where it is small, and nowhere else.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.types import FloatArray, IntArray, Points

_AT_ONCE: Final = 1 << 17
"""Pairs of segment and triangle held in memory."""


def crossing_margins(origins: Points, targets: Points, triangles: FloatArray) -> FloatArray:
    """By how much each segment crosses each triangle: (n, t) metres, positive if it does.

    Segments run from `origins` to `targets` (n, 3); `triangles` (t, 3, 3) have an area. The margin is the
    least of: the heights of the ends above and below the triangle's plane; the distance of the crossing
    point from the three edges, foreshortened as the segment sees it. Where one of these fails it is
    negative, by what fails most.
    """
    normal, inward = _frames(triangles)
    start = np.einsum("ntk,tk->nt", origins[:, None] - triangles[:, 0], normal)
    end = np.einsum("ntk,tk->nt", targets[:, None] - triangles[:, 0], normal)
    nearer = np.minimum(np.abs(start), np.abs(end))
    through = np.where((start > 0.0) != (end > 0.0), nearer, -nearer)
    fall = start - end
    parallel = fall == 0.0
    along = start / np.where(parallel, 1.0, fall)
    way = targets - origins
    point = origins[:, None] + along[:, :, None] * way[:, None]
    inside = np.einsum("ntek,tek->nte", point[:, :, None] - triangles, inward).min(axis=2)
    length = np.linalg.norm(way, axis=1)[:, None]
    slant = np.abs(fall) / np.where(length > 0.0, length, 1.0)
    return np.asarray(np.where(parallel, -nearer, np.minimum(through, inside * slant)))


def blocking_margin(origins: Points, targets: Points, triangles: FloatArray) -> FloatArray:
    """By how much each segment is blocked, (n,) metres: negative if it is free, -inf without triangles."""
    margin = np.full(len(origins), -np.inf)
    if len(triangles) == 0:
        return margin
    step = max(1, _AT_ONCE // len(triangles))
    for first in range(0, len(origins), step):
        part = slice(first, first + step)
        margin[part] = crossing_margins(origins[part], targets[part], triangles).max(axis=1)
    return margin


def first_hits(
    origins: Points, directions: FloatArray, triangles: FloatArray, reach: float
) -> tuple[IntArray, FloatArray]:
    """The first triangle hit within `reach` lengths of the directions (n, 3), or -1; and how many lengths."""
    nearest = np.full(len(origins), np.inf)
    triangle = np.full(len(origins), -1, dtype=np.int32)
    normal, _ = _frames(triangles)
    step = max(1, _AT_ONCE // max(1, len(triangles)))
    for first in range(0, len(origins) if len(triangles) else 0, step):
        part = slice(first, first + step)
        start, way = origins[part], directions[part]
        hit = crossing_margins(start, start + reach * way, triangles) > 0.0
        height = np.einsum("ntk,tk->nt", start[:, None] - triangles[:, 0], normal)
        fall = -(way @ normal.T)
        distance = np.where(hit, height / np.where(fall == 0.0, 1.0, fall), np.inf)
        nearest[part] = distance.min(axis=1)
        triangle[part] = np.where(hit.any(axis=1), distance.argmin(axis=1), -1)
    return triangle, nearest


def grid_points(polygon: Points, per_side: int) -> tuple[Points, FloatArray]:
    """Points in the middle of a grid over a planar convex polygon (3 or 4, 3), and the area of each cell.

    Returns (per_side^2, 3) and (per_side^2,). A triangle is a quadrilateral that repeats its last corner.
    """
    a, b, c, d = polygon if len(polygon) == 4 else polygon[[0, 1, 2, 2]]
    steps = (np.arange(per_side) + 0.5) / per_side
    u, v = (axis.ravel()[:, None] for axis in np.meshgrid(steps, steps))
    points = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
    along = (1 - v) * (b - a) + v * (c - d)
    across = (1 - u) * (d - a) + u * (c - b)
    return points, np.linalg.norm(np.cross(along, across), axis=1) / per_side**2


def visible_fraction(
    first: Points, second: Points, triangles: FloatArray, per_side: int, tolerance: float
) -> float:
    """Share of the light between two polygons that no triangle blocks; NaN where they don't face each other.

    By the midpoint rule in per_side^4 segments, each weighted with the kernel cos cos / r^2; its error falls
    with the inverse of `per_side`. A segment that is blocked by less than `tolerance` metres is free, so
    that the polygons' own triangles may be among `triangles`.
    """
    x, area_x = grid_points(first, per_side)
    y, area_y = grid_points(second, per_side)
    way = y[None] - x[:, None]
    square = (way**2).sum(axis=2)
    leaving = np.maximum(way @ _normal(first), 0.0)
    arriving = np.maximum(-(way @ _normal(second)), 0.0)
    weight = area_x[:, None] * area_y * leaving * arriving / np.where(square > 0.0, square, 1.0) ** 2
    used = weight > 0.0
    if not used.any():
        return float("nan")
    start = np.broadcast_to(x[:, None], way.shape)[used]
    end = np.broadcast_to(y[None], way.shape)[used]
    hidden = blocking_margin(start, end, triangles) > tolerance
    return 1.0 - float(weight[used][hidden].sum() / weight[used].sum())


def blocks(first: Points, second: Points, blocker: Points, per_side: int, tolerance: float) -> bool:
    """Whether light from the front of `first` to that of `second` is seen to be blocked by a polygon.

    Segments are sought that start at points of a grid on `first`, pass through points of a grid on
    `blocker`, and end within `second`, all by more than `tolerance` metres. True is certain; what is
    missed is narrower than the grids.
    """
    x, _ = grid_points(first, per_side)
    z, _ = grid_points(blocker, per_side)
    way = z[None] - x[:, None]
    facing, second_normal = _normal(first), _normal(second)
    # How far beyond the blocker, in lengths of `way`, the plane of `second` is met.
    fall = way @ second_normal
    height = (second[0] - z) @ second_normal
    beyond = height[None] / np.where(fall == 0.0, 1.0, fall)
    size = np.linalg.norm(way, axis=2)
    candidate = (
        (way @ facing > tolerance)
        & (fall < 0.0)
        & (beyond * size > tolerance)
        & (size > tolerance)
        & (np.abs(way @ _normal(blocker)) > tolerance)
        & (np.abs(height)[None] > tolerance)
    )
    rows, columns = np.nonzero(candidate)
    end = z[columns] + beyond[rows, columns, None] * way[rows, columns]
    corners = second if len(second) == 4 else second[[0, 1, 2]]
    edge = np.roll(corners, -1, axis=0) - corners
    inward = np.cross(second_normal, edge)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    inside = np.einsum("nek,ek->ne", end[:, None] - corners, inward)
    return bool((inside > tolerance).all(axis=1).any())


def _normal(polygon: Points) -> FloatArray:
    normal = np.cross(polygon[2] - polygon[0], polygon[-1] - polygon[1])
    return np.asarray(normal / np.linalg.norm(normal))


def _frames(triangles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (t, 3), and unit vectors in the plane that point inward from each edge (t, 3, 3)."""
    edge = np.roll(triangles, -1, axis=1) - triangles
    normal = np.cross(edge[:, 0], edge[:, 1])
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    inward = np.cross(normal[:, None], edge)
    return normal, inward / np.linalg.norm(inward, axis=2, keepdims=True)
