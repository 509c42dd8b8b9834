"""Wedges of sight lines: past an edge from a point of the source, or past a point from an edge of it.

A line from a source's point s at height h_s over the receiver, past a blocker's point b at height h_b, meets
the receiver at (h_s b - h_b s) / (h_s - h_b). Along an edge, all heights of that point over the receiver's
sides have linear numerators, which clip the edge ([H 6.2.3] speaks of a wedge intersection).

A wedge is (3, 3), metres: its apex, then the ends of its base. The apex is the source's point of a VE
discontinuity, the blocker's of an EV one.
"""

from __future__ import annotations

import math
from typing import Final

from solver.illumination.discontinuity.segments import Polygons, clip, height
from solver.kernels import kernel
from solver.types import FloatArray

HEIGHTS: Final = 6
"""Known of a point: its heights over the receiver, over the source, and inside of the receiver's sides."""


@kernel
def know_heights(
    polygons: Polygons, r: int, s: int, planes: FloatArray, sides: int, x: FloatArray, heights: FloatArray
) -> None:
    """Heights of a point (3,) over the receiver, over the source, and inside of the receiver's sides (6,)."""
    o = polygons.corners[r, 0]
    c = polygons.corners[s, 0]
    ns = polygons.normals[s]
    heights[0] = height(planes, 0, x[0] - o[0], x[1] - o[1], x[2] - o[2])
    heights[1] = ns[0] * (x[0] - c[0]) + ns[1] * (x[1] - c[1]) + ns[2] * (x[2] - c[2])
    for k in range(sides):
        heights[2 + k] = height(planes, 1 + k, x[0] - o[0], x[1] - o[1], x[2] - o[2])


@kernel
def shadow_of_edge(
    v: FloatArray, a: FloatArray, b: FloatArray, sides: int, tolerance: float
) -> tuple[float, float]:
    """The part of an edge whose shadow from a source's vertex falls on the receiver; heights (6,) of each.

    That is below the vertex, in front of receiver and source, and by more than `tolerance` somewhere.
    """
    if max(a[0], b[0]) <= tolerance or max(a[1], b[1]) <= tolerance:
        return 1.0, 0.0
    t0, t1 = clip(a[0], b[0], 0.0, 1.0)
    t0, t1 = clip(a[1], b[1], t0, t1)
    t0, t1 = clip(v[0] - tolerance - a[0], v[0] - tolerance - b[0], t0, t1)
    for k in range(2, 2 + sides):
        if t0 >= t1:
            break
        t0, t1 = clip(v[0] * a[k] - a[0] * v[k], v[0] * b[k] - b[0] * v[k], t0, t1)
    return t0, t1


@kernel
def shadow_of_vertex(
    a: FloatArray, b: FloatArray, w: FloatArray, sides: int, tolerance: float
) -> tuple[float, float]:
    """The part of a source's edge from which a vertex casts its shadow on the receiver; heights (6,)."""
    if w[0] <= tolerance or w[1] <= tolerance:
        return 1.0, 0.0
    t0, t1 = clip(a[0] - w[0] - tolerance, b[0] - w[0] - tolerance, 0.0, 1.0)
    for k in range(2, 2 + sides):
        if t0 >= t1:
            break
        t0, t1 = clip(a[0] * w[k] - w[0] * a[k], b[0] * w[k] - w[0] * b[k], t0, t1)
    return t0, t1


@kernel
def meet_receiver(
    wedge: FloatArray, u: float, planes: FloatArray, o: FloatArray, is_ev: bool, out: FloatArray
) -> float:
    """Where the line through apex and point u of the base meets the receiver, from its first corner (3,).

    Returns the height of the source's point over the blocker's.
    """
    high = 0.0
    low = 0.0
    for axis in range(3):
        apex = wedge[0, axis] - o[axis]
        base = wedge[1, axis] - o[axis] + u * (wedge[2, axis] - wedge[1, axis])
        high += planes[0, axis] * (base if is_ev else apex)
        low += planes[0, axis] * (apex if is_ev else base)
    for axis in range(3):
        apex = wedge[0, axis] - o[axis]
        base = wedge[1, axis] - o[axis] + u * (wedge[2, axis] - wedge[1, axis])
        if is_ev:
            out[axis] = (high * apex - low * base) / (high - low)
        else:
            out[axis] = (high * base - low * apex) / (high - low)
    return high - low


@kernel
def wedge_normal(wedge: FloatArray, normal: FloatArray) -> bool:
    """Unit normal (3,) of the plane through apex and base; whether there is one."""
    u = wedge[1] - wedge[0]
    v = wedge[2] - wedge[0]
    normal[0] = u[1] * v[2] - u[2] * v[1]
    normal[1] = u[2] * v[0] - u[0] * v[2]
    normal[2] = u[0] * v[1] - u[1] * v[0]
    length = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if length <= 0.0:
        return False
    for axis in range(3):
        normal[axis] /= length
    return True
