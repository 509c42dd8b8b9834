"""What is left of a convex polygon less others of its plane, in quadrilaterals and triangles."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.geometry.clipping import clip_to_plane
from solver.kernels import kernel
from solver.types import Corners, FloatArray, IntArray

MOST_CORNERS: Final = 24
"""Of a piece, between two of its cuts."""

_STRAIGHT: Final = 1e-12
"""A corner is left out if its turn spans at most this times the square of the piece's extent."""


@kernel
def subtract(
    polygon: FloatArray,
    count: int,
    normal: FloatArray,
    corners: Corners,
    counts: IntArray,
    covers: IntArray,
    margin: float,
) -> tuple[FloatArray, IntArray]:
    """Pieces (m, 4, 3), and their numbers of corners (m,), of a polygon less those of `covers`.

    polygon (>= count, 3) with unit `normal`; the polygons corners[covers] lie in its plane, wound either way.
    What is thinner than `margin` metres goes with what is cut off.
    """
    pieces = [_copy(polygon, count)]
    side = np.empty(3)
    for cover in covers:
        left = [_copy(polygon, 0)]
        left.pop()
        around = 1.0 if _turns_left(corners[cover], counts[cover], normal) else -1.0
        for piece in pieces:
            rest = piece
            for k in range(counts[cover]):
                # What is beyond this edge is left; what is on its inner side goes on to the next.
                offset = _side_plane(corners[cover], counts[cover], k, normal, around, side)
                out = np.empty((MOST_CORNERS, 3))
                kept = clip_to_plane(rest, len(rest), side, offset, margin, out)
                if kept >= 3:
                    left.append(_copy(out, kept))
                inner = np.empty((MOST_CORNERS, 3))
                kept = clip_to_plane(rest, len(rest), -side, -offset, margin, inner)
                rest = _copy(inner, kept)
                if kept < 3:
                    break
        pieces = left
    return _in_fours(pieces, normal)


@kernel
def _copy(polygon: FloatArray, count: int) -> FloatArray:
    return polygon[:count].copy()


@kernel
def _turns_left(polygon: FloatArray, count: int, normal: FloatArray) -> bool:
    """Whether a polygon is wound counter-clockwise as seen from the tip of `normal`."""
    total = 0.0
    for k in range(1, count - 1):
        total += _turn(polygon[0], polygon[k], polygon[k + 1], normal)
    return total > 0.0


@kernel
def _turn(a: FloatArray, b: FloatArray, c: FloatArray, normal: FloatArray) -> float:
    """Twice the area of a triangle, negative if it is clockwise."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - b[0], c[1] - b[1], c[2] - b[2]
    turn: float = (
        (uy * vz - uz * vy) * normal[0] + (uz * vx - ux * vz) * normal[1] + (ux * vy - uy * vx) * normal[2]
    )
    return turn


@kernel
def _side_plane(
    polygon: FloatArray, count: int, k: int, normal: FloatArray, around: float, side: FloatArray
) -> float:
    """Write the unit normal of the plane upon edge k, away from the polygon, to side (3,); its offset."""
    m = (k + 1) % count
    ex = polygon[m, 0] - polygon[k, 0]
    ey = polygon[m, 1] - polygon[k, 1]
    ez = polygon[m, 2] - polygon[k, 2]
    side[0] = around * (ey * normal[2] - ez * normal[1])
    side[1] = around * (ez * normal[0] - ex * normal[2])
    side[2] = around * (ex * normal[1] - ey * normal[0])
    length = np.sqrt(side[0] ** 2 + side[1] ** 2 + side[2] ** 2)
    for axis in range(3):
        side[axis] /= length
    return float(side[0] * polygon[k, 0] + side[1] * polygon[k, 1] + side[2] * polygon[k, 2])


@kernel
def _in_fours(pieces: list[FloatArray], normal: FloatArray) -> tuple[FloatArray, IntArray]:
    """Convex pieces of any number of corners as quadrilaterals, and a triangle where one is left over."""
    most = 0
    for piece in pieces:
        most += len(piece)
    corners = np.empty((most, 4, 3))
    counts = np.empty(most, dtype=np.int32)
    made = 0
    for piece in pieces:
        kept = _without_straight(piece, normal)
        first = 1
        while first < kept - 1:
            n = 4 if first + 2 < kept else 3
            corners[made, 0] = piece[0]
            for k in range(3):
                corners[made, k + 1] = piece[min(first + k, first + n - 2)]
            counts[made] = n
            made += 1
            first += n - 2
    return corners[:made], counts[:made]


@kernel
def _without_straight(piece: FloatArray, normal: FloatArray) -> int:
    """Let the corners go at which the border of a piece runs straight on; how many are left."""
    extent = 0.0
    for k in range(len(piece)):
        for axis in range(3):
            extent = max(extent, abs(piece[k, axis] - piece[0, axis]))
    kept = len(piece)
    k = 0
    while k < kept and kept >= 3:
        if _turn(piece[k - 1 if k > 0 else kept - 1], piece[k], piece[(k + 1) % kept], normal) <= (
            _STRAIGHT * extent * extent
        ):
            for m in range(k, kept - 1):
                piece[m] = piece[m + 1]
            kept -= 1
            k = max(k - 1, 0)
        else:
            k += 1
    return kept
