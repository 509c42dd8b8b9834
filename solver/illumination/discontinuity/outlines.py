"""The outlines of a scene's polygons: welded vertices, the edges between them, and the sheets along each.

Patches are loose polygons. Welded by their corners they share edges, so that it can be told where a flat
face is only cut in pieces, and which edges bound a shadow (`silhouettes`). Edges that only touch, without
common corners, count as open ones.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.grouping import settle, unite
from solver.kernels import kernel
from solver.types import BoolArray, FloatArray, IntArray, Points

WELD: Final = 1e-7
"""Corners are one if they are no further apart than this times the scene's size; corners up to 7 times as
far may be."""

FLAT: Final = 1e-5
"""Two patches are one plane at their common edge if they bend there by at most this angle, radians; an
outline that bends by no more at a corner runs straight on."""


class Outlines(NamedTuple):
    """v welded vertices, e edges between them, and the s sheets (patches of side 0) that edges bound."""

    point: Points
    """(v, 3) metres"""
    vertex: IntArray
    """(p, 4) of each patch corner"""
    edge: IntArray
    """(p, 4) from each patch corner to the next; -1 where there is none"""
    ends: IntArray
    """(e, 2) vertices of each edge"""
    is_flat: BoolArray
    """(e,) whether two sheets go on into each other: such an edge bounds no shadow, seen from anywhere"""
    is_inner: BoolArray
    """(e,) whether it only parts two patches of one flat face of one object"""
    sheet_start: IntArray
    """(e + 1,) first sheet of each edge"""
    sheet_normal: FloatArray
    """(s, 3) unit normal of each sheet, turned so that the sheet is on the left of its edge"""
    spoke_start: IntArray
    """(v + 1,) first spoke of each vertex"""
    spoke: IntArray
    """(2 e,) edges that end at each vertex"""
    is_corner: BoolArray
    """(p, 4) whether the outline of a patch's whole flat face has a corner there"""
    widest_fan: int
    """Most sheets along the edges of one vertex"""


def find_outlines(surfaces: Surfaces) -> Outlines:
    """The outlines of all patches of `surfaces`."""
    p = surfaces.patch_count
    patch, slot = np.nonzero(np.arange(4) < surfaces.corner_count[:, None])
    following = (slot + 1) % surfaces.corner_count[patch]
    corner = surfaces.corners[patch, slot]
    label = _weld((corner - surfaces.center) / (WELD * surfaces.size))
    _, first, welded = np.unique(label, return_index=True, return_inverse=True)
    point = np.ascontiguousarray(corner[first])
    vertex = np.zeros((p, 4), dtype=np.int32)
    vertex[patch, slot] = welded

    # Edges by their ends; what welding has shrunk to a point is none.
    a, b = vertex[patch, slot], vertex[patch, following]
    real = a != b
    key = np.minimum(a, b).astype(np.int64) * len(point) + np.maximum(a, b)
    edge = np.full((p, 4), -1, dtype=np.int32)
    keys, named = np.unique(key[real], return_inverse=True)
    edge[patch[real], slot[real]] = named
    ends = np.stack([keys // max(1, len(point)), keys % max(1, len(point))], axis=1).astype(np.int32)

    # Sheets: a polygon blocks whichever side light comes from, so its back is not told apart.
    front = real & (surfaces.side[patch] == 0)
    of_edge, owner = edge[patch[front], slot[front]], patch[front]
    order = np.argsort(of_edge, kind="stable")
    of_edge, owner = of_edge[order], owner[order].astype(np.int32)
    along = np.where(a[front] < b[front], 1.0, -1.0)[order]
    normal = np.ascontiguousarray(surfaces.normal[owner] * along[:, None])
    sheet_start = _starts(of_edge, len(ends))
    direction = point[ends[:, 1]] - point[ends[:, 0]]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    is_flat, is_inner = np.zeros(len(ends), dtype=np.bool_), np.zeros(len(ends), dtype=np.bool_)
    _find_flat(direction, sheet_start, owner, normal, surfaces.normal, surfaces.object, is_flat, is_inner)

    spoke_of = ends.T.ravel()
    spoke = (np.argsort(spoke_of, kind="stable") % max(1, len(ends))).astype(np.int32)
    fan = np.bincount(spoke_of, np.tile(np.diff(sheet_start), 2), len(point))
    return Outlines(
        point=point,
        vertex=vertex,
        edge=edge,
        ends=ends,
        is_flat=is_flat,
        is_inner=is_inner,
        sheet_start=sheet_start,
        sheet_normal=normal,
        spoke_start=_starts(spoke_of, len(point)),
        spoke=spoke,
        is_corner=_find_corners(surfaces, vertex, edge, is_inner, point),
        widest_fan=int(fan.max(initial=0.0)),
    )


def _starts(owner: IntArray, count: int) -> IntArray:
    """First entry of each of `count` owners in a list that is sorted by them, (count + 1,)."""
    return np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=count))]).astype(np.int32)


def _weld(points: Points) -> IntArray:
    """Numbers that are equal for points (n, 3) that are at most 1 apart along each axis.

    Cells are 4 wide: of two grids that are shifted by half a cell one has both points in one cell, axis by
    axis.
    """
    label = np.arange(len(points), dtype=np.int32)
    for shift in np.ndindex(2, 2, 2):
        cell = np.floor(0.25 * points + 0.5 * np.array(shift)).astype(np.int64)
        order = np.lexsort(cell.T)
        differs = np.any(cell[order[1:]] != cell[order[:-1]], axis=1)
        unite(order, differs, label)
    settle(label)
    return label


@kernel
def _find_flat(
    direction: FloatArray,
    sheet_start: IntArray,
    owner: IntArray,
    normal: FloatArray,
    patch_normal: FloatArray,
    patch_object: IntArray,
    is_flat: BoolArray,
    is_inner: BoolArray,
) -> None:
    """Which edges part two sheets that go on into each other, and which of those are of one face."""
    for e in range(len(direction)):
        first = sheet_start[e]
        last = sheet_start[e + 1]
        for i in range(first, last):
            for j in range(first, i):
                # Sheets of one plane on different sides of the edge have opposite turned normals.
                bend = 0.0
                for axis in range(3):
                    bend += (normal[i, axis] + normal[j, axis]) ** 2
                if bend > FLAT * FLAT:
                    continue
                is_flat[e] = True
                if last - first == 2 and patch_object[owner[i]] == patch_object[owner[j]]:
                    same = 0.0
                    for axis in range(3):
                        same += patch_normal[owner[i], axis] * patch_normal[owner[j], axis]
                    is_inner[e] = same > 0.0


def _find_corners(
    surfaces: Surfaces, vertex: IntArray, edge: IntArray, is_inner: BoolArray, point: Points
) -> BoolArray:
    """(p, 4) at which corners the outline of the whole flat face that a patch is part of turns."""
    # Patches that share an inner edge, on the same side, are one face.
    patch, slot = np.nonzero(edge >= 0)
    across = edge[patch, slot]
    inner = is_inner[across]
    key = 2 * across[inner].astype(np.int64) + surfaces.side[patch[inner]]
    order = np.argsort(key, kind="stable")
    face = np.arange(surfaces.patch_count, dtype=np.int32)
    unite(patch[inner][order], np.diff(key[order]) != 0, face)
    settle(face)
    # The outline's edges at each of a face's vertices: two that point against each other run straight on.
    patch, slot = patch[~inner], slot[~inner]
    start = vertex[patch, slot]
    end = vertex[patch, (slot + 1) % surfaces.corner_count[patch]]
    direction = point[end] - point[start]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    at = np.concatenate([start, end])
    key = face[np.concatenate([patch, patch])].astype(np.int64) * len(point) + at
    keys, row, count = np.unique(key, return_inverse=True, return_counts=True)
    total = np.zeros((len(keys), 3))
    np.add.at(total, row, np.concatenate([direction, -direction]))
    turns = (count != 2) | (np.linalg.norm(total, axis=1) > FLAT)
    # Corners that are none of the outline's are not in the table.
    patch, slot = np.nonzero(np.arange(4) < surfaces.corner_count[:, None])
    wanted = face[patch].astype(np.int64) * len(point) + vertex[patch, slot]
    place = np.minimum(np.searchsorted(keys, wanted), max(0, len(keys) - 1))
    is_corner = np.zeros((surfaces.patch_count, 4), dtype=np.bool_)
    is_corner[patch, slot] = (keys[place] == wanted) & turns[place]
    return is_corner
