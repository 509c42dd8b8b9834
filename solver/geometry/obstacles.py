"""Which faces need not be asked what they hide from a point, since others tell, or nothing is beyond them.

A ray that meets a convex solid enters it through a face that looks at where the ray comes from: faces that
look away from a point outside hide nothing besides, about half of all where scenes are made of boxes. Where a
solid stands on something, and what they have in common is cut away, the opening must look away, too. And a
face with all of the scene on one side of it, as a wall of a room, hides nothing from what is on that side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.surfaces import Surfaces
from solver.kernels import inline_kernel, kernel
from solver.types import BoolArray, Corners, FloatArray, Int64Array, IntArray

LOW: Final = 0
HIGH: Final = 3
OPENING: Final = 6
OFFSET: Final = 9
BOUNDS: Final = 10
"""Columns of a solid's bounds: lower and upper corner of its box, a little larger than it; outward unit
normal of its opening, 0 where it has none, and where that is along the normal, metres."""

ALONE: Final = -1
ALL_BEFORE: Final = -2
ALL_BEHIND: Final = -3
"""What a patch is where it is not of a solid: nothing but itself, or one with the whole scene on one side."""

_MOST: Final = 2048
"""A solid of more faces is taken for none: every face is held against the corners of all."""

_MOST_WALLS: Final = 4096
"""In a scene of more faces no walls are looked for, for the same reason."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """p patches and the s convex solids, each of one object, that some of them enclose."""

    solid: IntArray
    """(p,) that a patch is a face of, or ALONE, ALL_BEFORE, ALL_BEHIND"""
    bounds: FloatArray
    """(s, BOUNDS)"""


def find_obstacles(surfaces: Surfaces) -> Obstacles:
    """What the fronts of `surfaces` are, to the tolerance `SIDE`."""
    fronts = np.flatnonzero(surfaces.side == 0).astype(np.int32)
    corners, counts = surfaces.corners[fronts], surfaces.corner_count[fronts]
    n = len(fronts)
    solid = np.full(surfaces.patch_count, ALONE, dtype=np.int32)
    if n == 0:
        return Obstacles(solid, np.empty((0, BOUNDS)))
    start, end, patch = _edges(corners, counts, surfaces.object[fronts])
    other, is_simple = _neighbours(start, end, patch)
    label = np.arange(n, dtype=np.int32)
    _unite(patch, other, label)
    _, part = np.unique(label, return_inverse=True)
    order = np.argsort(part, kind="stable").astype(np.int32)
    first = np.searchsorted(part[order], np.arange(int(part.max()) + 2)).astype(np.int64)
    simple = np.ones(len(first) - 1, dtype=np.bool_)
    simple[part[patch[~is_simple]]] = False
    is_open = np.zeros((n, 4), dtype=np.bool_)
    open_edges = np.flatnonzero(other < 0)
    is_open[patch[open_edges], _number_in_patch(patch)[open_edges]] = True
    bounds = np.zeros((len(first) - 1, BOUNDS))
    is_solid = np.zeros(len(first) - 1, dtype=np.bool_)
    flat = tolerances.SIDE * surfaces.size
    _judge(
        corners, counts, surfaces.normal[fronts], is_open, order, first, simple,
        flat, tolerances.TOUCH * surfaces.size, bounds, is_solid,
    )  # fmt: skip
    number = np.where(is_solid, np.cumsum(is_solid) - 1, ALONE).astype(np.int32)
    found = number[part]
    if n <= _MOST_WALLS:
        _look_beyond(corners, counts, surfaces.normal[fronts], _outermost(corners), flat, found)
    solid[fronts] = found
    return Obstacles(solid, bounds[is_solid])


@inline_kernel
def is_needless(x: FloatArray, behind: bool, solid: int, bounds: FloatArray, tolerance: float) -> bool:
    """Whether a face hides nothing from a point x (3,) that others do not, by what it is (`Obstacles.solid`).

    The point is `behind` the face, or before it, and outside of a solid that it is not in the box of; it may
    be on the plane of the solid's opening, to within `tolerance` metres.
    """
    needless = (solid == ALL_BEFORE and not behind) or (solid == ALL_BEHIND and behind)
    if solid >= 0 and behind:
        over = -bounds[solid, OFFSET]
        for axis in range(3):
            over += bounds[solid, OPENING + axis] * x[axis]
            is_apart = x[axis] < bounds[solid, LOW + axis] or x[axis] > bounds[solid, HIGH + axis]
            needless = needless or is_apart
        needless = needless and over <= tolerance
    return needless


def _edges(corners: Corners, counts: IntArray, owner: IntArray) -> tuple[Int64Array, Int64Array, IntArray]:
    """Directed edges by numbers of their ends, which no two owners share, and the patch that each is of."""
    places = np.empty((4 * len(counts), 4))
    # No zero is negative: places are told apart by their bits.
    places[:, :3] = corners.reshape(-1, 3) + 0.0
    places[:, 3] = np.repeat(owner, 4)
    rows = places.view(np.dtype((np.void, places.itemsize * 4))).ravel()
    number = np.unique(rows, return_inverse=True)[1].reshape(-1, 4).astype(np.int64)
    k = np.arange(4)
    following = np.where(k + 1 < counts[:, None], k + 1, 0)
    start, end = number, np.take_along_axis(number, following, axis=1)
    is_edge = k < counts[:, None]
    patch = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    return start[is_edge], end[is_edge], patch


def _neighbours(start: Int64Array, end: Int64Array, patch: IntArray) -> tuple[IntArray, BoolArray]:
    """(e,) the patch on the other side of each edge, -1 if there is none; (e,) whether there is but one."""
    span = int(max(start.max(), end.max())) + 1
    there, back = start * span + end, end * span + start
    order = np.argsort(there, kind="stable")
    ranked = there[order]
    at = np.searchsorted(ranked, back)
    found = ranked[np.minimum(at, len(ranked) - 1)] == back
    other = np.where(found, patch[order[np.minimum(at, len(order) - 1)]], -1).astype(np.int32)
    alike = np.searchsorted(ranked, there, side="right") - np.searchsorted(ranked, there)
    against = np.searchsorted(ranked, back, side="right") - at
    return other, (alike == 1) & (against <= 1) & (start != end)


def _number_in_patch(patch: IntArray) -> Int64Array:
    """Of edges sorted by patch (e,), the number of each among those of its patch."""
    return np.arange(len(patch), dtype=np.int64) - np.searchsorted(patch, patch)


def _outermost(corners: Corners) -> IntArray:
    """The patches with the lowest and highest corners along the axes: where few faces have nothing beyond."""
    heights = corners.reshape(-1, 3)
    return np.unique(np.concatenate([heights.argmin(axis=0), heights.argmax(axis=0)]) // 4).astype(np.int32)


@kernel
def _unite(patch: IntArray, other: IntArray, label: IntArray) -> None:
    """Union-find over edges with a patch on either side; every label becomes its root."""
    for e in range(len(patch)):
        if other[e] < 0:
            continue
        a = patch[e]
        b = other[e]
        while label[a] != a:
            a = label[a]
        while label[b] != b:
            b = label[b]
        label[max(a, b)] = min(a, b)
    for i in range(len(label)):
        label[i] = label[label[i]]


@kernel
def _judge(
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    is_open: BoolArray,
    order: IntArray,
    first: Int64Array,
    simple: BoolArray,
    tolerance: float,
    margin: float,
    bounds: FloatArray,
    is_solid: BoolArray,
) -> None:
    """Fill in the bounds of parts order[first[s] : first[s + 1]], and whether they are solids.

    is_open (n, 4): edges with nothing on the other side. Tolerances are metres: of planes, and of boxes.
    """
    for s in range(len(simple)):
        begin = first[s]
        stop = first[s + 1]
        if not simple[s] or stop - begin < 3 or stop - begin > _MOST:
            continue
        _open(corners, counts, is_open, order, begin, stop, bounds, s)
        has_opening = False
        for axis in range(3):
            has_opening = has_opening or bounds[s, OPENING + axis] != 0.0
        good = True
        for i in range(begin, stop):
            p = order[i]
            for k in range(counts[p]):
                good = good and (has_opening or not is_open[p, k])
                over = -bounds[s, OFFSET]
                for axis in range(3):
                    over += bounds[s, OPENING + axis] * corners[p, k, axis]
                good = good and over <= tolerance and (not is_open[p, k] or over >= -tolerance)
            if good and not _is_below(corners, counts, normals, p, order, begin, stop, tolerance):
                good = False
            if not good:
                break
        is_solid[s] = good
        for axis in range(3):
            low = corners[order[begin], 0, axis]
            high = low
            for i in range(begin, stop):
                for k in range(counts[order[i]]):
                    low = min(low, corners[order[i], k, axis])
                    high = max(high, corners[order[i], k, axis])
            bounds[s, LOW + axis] = low - margin
            bounds[s, HIGH + axis] = high + margin


@kernel
def _open(
    corners: Corners,
    counts: IntArray,
    is_open: BoolArray,
    order: IntArray,
    begin: int,
    stop: int,
    bounds: FloatArray,
    s: int,
) -> None:
    """Find the plane of a part's open edges; its normal is 0 where there are none, or they have no area."""
    normal = np.zeros(3)
    reach = -np.inf
    base = corners[order[begin], 0]
    for i in range(begin, stop):
        p = order[i]
        for k in range(counts[p]):
            if is_open[p, k]:
                a = corners[p, k] - base
                b = corners[p, k + 1 if k + 1 < counts[p] else 0] - base
                # The opening runs the other way around.
                normal -= np.cross(a, b)
    length = np.sqrt((normal * normal).sum())
    for axis in range(3):
        bounds[s, OPENING + axis] = normal[axis] / length if length > 0.0 else 0.0
    for i in range(begin, stop):
        p = order[i]
        for k in range(counts[p]):
            if is_open[p, k]:
                at = 0.0
                for axis in range(3):
                    at += bounds[s, OPENING + axis] * corners[p, k, axis]
                reach = max(reach, at)
    bounds[s, OFFSET] = reach if length > 0.0 else 0.0


@kernel
def _is_below(
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    p: int,
    order: IntArray,
    begin: int,
    stop: int,
    tolerance: float,
) -> bool:
    """Whether all corners of a part are on the inner side of the plane of its patch p."""
    for i in range(begin, stop):
        q = order[i]
        for k in range(counts[q]):
            over = 0.0
            for axis in range(3):
                over += normals[p, axis] * (corners[q, k, axis] - corners[p, 0, axis])
            if over > tolerance:
                return False
    return True


@kernel
def _look_beyond(
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    outermost: IntArray,
    tolerance: float,
    solid: IntArray,
) -> None:
    """Mark patches that are ALONE where all corners (n, 4, 3) are on one side of them."""
    for p in range(len(counts)):
        if solid[p] != ALONE:
            continue
        before = True
        behind = True
        for i in range(-len(outermost), len(counts)):
            q = outermost[-1 - i] if i < 0 else i
            for k in range(counts[q]):
                over = 0.0
                for axis in range(3):
                    over += normals[p, axis] * (corners[q, k, axis] - corners[p, 0, axis])
                before = before and over >= -tolerance
                behind = behind and over <= tolerance
            if not before and not behind:
                break
        if before != behind:
            solid[p] = ALL_BEFORE if before else ALL_BEHIND
