"""What the kernels of point irradiance work on: elements, light on them, and a desk for those that wait."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from solver.illumination.cuts import ROOM, Buffers, make_buffers
from solver.illumination.factor_lanes import BLOCK, LANES
from solver.illumination.pyramids import PYRAMID
from solver.kernels import kernel
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


class Light(NamedTuple):
    """Radiosity on n elements, as in `light.Sources`."""

    functions: FloatArray
    luminance: FloatArray
    spread: FloatArray
    slope: FloatArray
    extent: FloatArray


class Desk(NamedTuple):
    """Elements that wait to be looked at, and what the work on them needs."""

    element: IntArray
    """(DEPTH,)"""
    first: IntArray
    """(DEPTH,) where their blockers begin in `pool`"""
    blockers: IntArray
    """(DEPTH,) how many there are"""
    visibility: FloatArray
    """(DEPTH,) of their links"""
    pool: IntArray
    """patches that may hide something, lists one behind the other"""
    lane: IntArray
    """(LANES, 3) element, first and blockers of each lane"""
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
    buffers: Buffers


@kernel
def make_desk(most_blockers: int) -> Desk:
    """For elements with so many blockers at most."""
    return Desk(
        np.empty(DEPTH, dtype=np.int32),
        np.empty(DEPTH, dtype=np.int32),
        np.empty(DEPTH, dtype=np.int32),
        np.empty(DEPTH),
        np.empty((LANES + 1) * most_blockers + _LISTS, dtype=np.int32),
        np.empty((LANES, 3), dtype=np.int32),
        np.empty(LANES),
        np.zeros(BLOCK),
        np.empty((1, PYRAMID)),
        np.empty(4),
        np.empty((PARTS, ROOM, 3)),
        np.empty(PARTS, dtype=np.int32),
        make_buffers(most_blockers),
    )


@kernel
def lay(desk: Desk, at: int, element: int, first: int, blockers: int, visibility: float) -> None:
    """Let an element wait at a place of the desk."""
    desk.element[at] = element
    desk.first[at] = first
    desk.blockers[at] = blockers
    desk.visibility[at] = visibility


@kernel
def height_before(x: FloatArray, corners: Corners, polygon: int, normals: FloatArray, plane: int) -> float:
    """Metres by which a point is before the front of a row of corners (n, 4, 3)."""
    height = 0.0
    for axis in range(3):
        height += normals[plane, axis] * (x[axis] - corners[polygon, 0, axis])
    return height


@kernel
def relative_polygon(
    x: FloatArray, corners: Corners, polygon: int, count: int, polygons: FloatArray, slot: int
) -> None:
    """Write a row of corners (n, 4, 3), relative to the point, to a row of polygons (s, >= 4, 3)."""
    for corner in range(count):
        for axis in range(3):
            polygons[slot, corner, axis] = corners[polygon, corner, axis] - x[axis]
