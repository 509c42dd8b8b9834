"""What the kernels of point irradiance work on: elements, light on them, and a desk for those that wait."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from solver.illumination.points.cuts import ROOM, Buffers, make_buffers
from solver.illumination.points.factor_lanes import BLOCK, LANES
from solver.illumination.points.pyramids import PYRAMID
from solver.kernels import inline_kernel, kernel
from solver.types import Corners, FloatArray, IntArray, Points

DEPTH: Final = 512
"""Elements waiting to be looked at; where there are more, they are not entered."""

PARTS: Final = 64
"""Visible pieces whose place is looked at; those that are more count as much as these do."""

_LISTS: Final = 4096
"""Room for the blockers of elements that wait, beside those of the sources; where it is used up, elements
have all blockers of their parents."""


class Elements(NamedTuple):
    """What is asked of the n elements of a tree over p patches."""

    child: IntArray
    child_count: IntArray
    corners: Corners
    corner_count: IntArray
    patch: IntArray
    centroid: Points
    axes: FloatArray
    """(p, 2, 3)"""
    normals: FloatArray
    """(p, 3)"""
    solid: IntArray
    """(p,) what patches are, as `Obstacles` has it"""
    bounds: FloatArray
    """(s, BOUNDS) of the solids"""


class Light(NamedTuple):
    """Radiosity on n elements, as in `light.Sources`."""

    functions: FloatArray
    luminance: FloatArray
    spread: FloatArray
    slope: FloatArray
    extent: FloatArray


class Desk(NamedTuple):
    """Elements that wait to be looked at, or quarters of leaves, and what the work on them needs."""

    waiting: IntArray
    """(DEPTH, 4) element; where its blockers begin in `pool`; how many there are; times it was quartered"""
    polygon: FloatArray
    """(DEPTH, 4, 3) corners relative to the point"""
    visibility: FloatArray
    """(DEPTH,) of their links"""
    pool: IntArray
    """patches that may hide something, lists one behind the other"""
    lane: IntArray
    """(LANES, 4) as `waiting`, of each lane"""
    lane_visibility: FloatArray
    """(LANES,)"""
    block: FloatArray
    """(BLOCK,)"""
    pyramid: FloatArray
    """(1, PYRAMID) an element's own, as a source"""
    place: FloatArray
    """(4,) weight, and place times weight, whence its light comes"""
    parts: FloatArray
    """(PARTS, ROOM, 3) its visible pieces"""
    part_count: IntArray
    """(PARTS,)"""
    origin: FloatArray
    """(3,) the point, where places are relative to it"""
    buffers: Buffers


@kernel
def make_desk(most_blockers: int) -> Desk:
    """For elements with so many blockers at most."""
    return Desk(
        np.empty((DEPTH, 4), dtype=np.int32),
        np.empty((DEPTH, 4, 3)),
        np.empty(DEPTH),
        np.empty((LANES + 1) * most_blockers + _LISTS, dtype=np.int32),
        np.empty((LANES, 4), dtype=np.int32),
        np.empty(LANES),
        np.zeros(BLOCK),
        np.empty((1, PYRAMID)),
        np.empty(4),
        np.empty((PARTS, ROOM, 3)),
        np.empty(PARTS, dtype=np.int32),
        np.zeros(3),
        make_buffers(most_blockers),
    )


@inline_kernel
def relative_polygon(
    x: FloatArray, corners: Corners, polygon: int, count: int, polygons: FloatArray, slot: int
) -> None:
    """Write a row of corners (n, 4, 3), relative to the point, to a row of polygons (s, >= 4, 3)."""
    for corner in range(count):
        for axis in range(3):
            polygons[slot, corner, axis] = corners[polygon, corner, axis] - x[axis]


@kernel
def lay(
    waiting: IntArray,
    polygons: FloatArray,
    visibilities: FloatArray,
    at: int,
    x: FloatArray,
    corners: Corners,
    element: int,
    first: int,
    blockers: int,
    visibility: float,
) -> None:
    """Let an element, of corners (n, 4, 3), wait at a place of the desk, for a point x (3,)."""
    waiting[at, 0] = element
    waiting[at, 1] = first
    waiting[at, 2] = blockers
    waiting[at, 3] = 0
    visibilities[at] = visibility
    relative_polygon(x, corners, element, 4, polygons, at)


@kernel
def height_before(x: FloatArray, corners: Corners, polygon: int, normals: FloatArray, plane: int) -> float:
    """Metres by which a point is before the front of a row of corners (n, 4, 3)."""
    height = 0.0
    for axis in range(3):
        height += normals[plane, axis] * (x[axis] - corners[polygon, 0, axis])
    return height
