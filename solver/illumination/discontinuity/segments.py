"""Segments on a receiver: the planes that bound it, clipping to them, and the table that segments go to.

Coordinates are taken from the receiver's first corner, so that a scene far from the origin keeps its
digits. Clipping is by linear functions of a segment's parameter: a shadow's points are quotients, but the
sign of their height over a side of the receiver is that of the numerator, so that nothing is ever divided
by a distance that may vanish.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import inline_kernel, kernel
from solver.types import Corners, FloatArray, IntArray, Points

VE: Final = 0
EV: Final = 1
HORIZON: Final = 2
CONTACT: Final = 3
GRAZE: Final = 4
"""Kinds: the shadow of an edge from a vertex of the source, that of a vertex from an edge of it, the line
where the source's plane meets the receiver, where something touches the receiver, and where a blocker that
hides some of the source is seen edge-on."""

SHORTEST: Final = 1e-4
"""A segment counts if it is longer than this times its receiver's size."""

BORDER: Final = 1e-6
"""A segment lies on its receiver's border if both ends are closer to one side than this times its size."""

SAMPLES: Final = 3
"""Where on a segment its strength is known: first end, middle, last end."""

ID_FIELDS: Final = 4
"""Columns of a row of ids: receiver, source, blocker, kind."""

FIELDS: Final = 7 + 3 * SAMPLES
"""Columns of a row: two ends, greatest d_sb / d_br, then per sample form factor, width and bend."""


class Polygons(NamedTuple):
    """What kernels need of p patches."""

    corners: Corners
    """(p, 4, 3) metres"""
    counts: IntArray
    """(p,) 3 or 4"""
    normals: FloatArray
    """(p, 3)"""
    areas: FloatArray
    """(p,) m2"""
    middles: Points
    """(p, 3) mean of the corners, metres"""
    radii: FloatArray
    """(p,) distance of the farthest corner from the middle, m"""


def polygons_of(surfaces: Surfaces) -> Polygons:
    """The patches of `surfaces`."""
    is_corner = np.arange(4) < surfaces.corner_count[:, None]
    middles = (surfaces.corners * is_corner[:, :, None]).sum(axis=1) / surfaces.corner_count[:, None]
    reach = np.linalg.norm(surfaces.corners - middles[:, None], axis=2)
    return Polygons(
        surfaces.corners, surfaces.corner_count, surfaces.normal, surfaces.area, middles,
        reach.max(axis=1, initial=0.0),
    )  # fmt: skip


@kernel
def receiver_planes(polygons: Polygons, patch: int, planes: FloatArray) -> int:
    """The patch's plane, then those through its sides, inside above 0: rows (a, b, c, d) of planes (5, 4).

    Heights are a x + b y + c z - d, with x from the patch's first corner. Returns the number of sides.
    """
    n = polygons.counts[patch]
    normal = polygons.normals[patch]
    for axis in range(3):
        planes[0, axis] = normal[axis]
    planes[0, 3] = 0.0
    for k in range(n):
        m = (k + 1) % n
        a = polygons.corners[patch, k]
        b = polygons.corners[patch, m]
        ex = b[0] - a[0]
        ey = b[1] - a[1]
        ez = b[2] - a[2]
        px = normal[1] * ez - normal[2] * ey
        py = normal[2] * ex - normal[0] * ez
        pz = normal[0] * ey - normal[1] * ex
        length = math.sqrt(px * px + py * py + pz * pz)
        planes[1 + k, 0] = px / length
        planes[1 + k, 1] = py / length
        planes[1 + k, 2] = pz / length
        o = polygons.corners[patch, 0]
        planes[1 + k, 3] = (px * (a[0] - o[0]) + py * (a[1] - o[1]) + pz * (a[2] - o[2])) / length
    return int(n)


@kernel
def patch_diameter(polygons: Polygons, patch: int) -> float:
    """Greatest distance of two corners, m."""
    square = 0.0
    for k in range(polygons.counts[patch]):
        for m in range(k):
            d = 0.0
            for axis in range(3):
                d += (polygons.corners[patch, k, axis] - polygons.corners[patch, m, axis]) ** 2
            square = max(square, d)
    return math.sqrt(square)


@inline_kernel
def height(planes: FloatArray, k: int, x: float, y: float, z: float) -> float:
    """Signed distance from plane k of a point given relative to the receiver's first corner, m."""
    return float(planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] * z - planes[k, 3])


@inline_kernel
def clip(g0: float, g1: float, t0: float, t1: float) -> tuple[float, float]:
    """The part of [t0, t1] where the linear function that is g0 at 0 and g1 at 1 is not negative."""
    if g0 < 0.0:
        if g1 <= 0.0:
            return 1.0, 0.0
        return max(t0, g0 / (g0 - g1)), t1
    if g1 < 0.0:
        return t0, min(t1, g0 / (g0 - g1))
    return t0, t1


@kernel
def clip_to_sides(planes: FloatArray, sides: int, segment: FloatArray) -> bool:
    """Clip a segment (2, 3) to the inside of the receiver's sides, in place; whether any of it is left.

    Its ends are relative to the receiver's first corner.
    """
    t0 = 0.0
    t1 = 1.0
    for k in range(1, 1 + sides):
        g0 = height(planes, k, segment[0, 0], segment[0, 1], segment[0, 2])
        g1 = height(planes, k, segment[1, 0], segment[1, 1], segment[1, 2])
        t0, t1 = clip(g0, g1, t0, t1)
        if t0 >= t1:
            return False
    for axis in range(3):
        a = segment[0, axis]
        step = segment[1, axis] - a
        segment[0, axis] = a + t0 * step
        segment[1, axis] = a + t1 * step
    return True


@kernel
def counts_as_segment(planes: FloatArray, sides: int, segment: FloatArray, size: float) -> bool:
    """Whether a segment (2, 3) on a receiver of that size (m) is long enough and not on its border."""
    square = 0.0
    for axis in range(3):
        square += (segment[1, axis] - segment[0, axis]) ** 2
    if square <= (SHORTEST * size) ** 2:
        return False
    for k in range(1, 1 + sides):
        far = max(
            height(planes, k, segment[0, 0], segment[0, 1], segment[0, 2]),
            height(planes, k, segment[1, 0], segment[1, 1], segment[1, 2]),
        )
        if far <= BORDER * size:
            return False
    return True


@kernel
def write_segment(
    polygons: Polygons,
    receiver: int,
    source: int,
    blocker: int,
    kind: int,
    segment: FloatArray,
    used: int,
    rows: FloatArray,
    ids: IntArray,
) -> None:
    """Write the ends and ids of a segment (2, 3), given from the receiver's first corner, to row `used`."""
    for end in range(2):
        for axis in range(3):
            rows[used, 3 * end + axis] = polygons.corners[receiver, 0, axis] + segment[end, axis]
    ids[used, 0] = receiver
    ids[used, 1] = source
    ids[used, 2] = blocker
    ids[used, 3] = kind
