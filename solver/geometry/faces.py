"""Input faces become convex planar patches: quadrilaterals and triangles, counter-clockwise from the front.

Triangles and planar convex quadrilaterals pass as they are; concave and larger polygons are
triangulated by ear clipping in their own plane; a quadrilateral that is not planar is split along the
diagonal that keeps both halves convex to its mean normal; faces without area are dropped and counted.
"""

from __future__ import annotations

from dataclasses import dataclass

import mapbox_earcut
import numpy as np

from solver import tolerances
from solver.types import BoolArray, Corners, FloatArray, IntArray, Points


@dataclass(frozen=True, eq=False)
class FacePatches:
    """The convex patches of a list of faces."""

    corners: Corners
    """(p, 4, 3) metres; a triangle repeats its last corner."""
    corner_count: IntArray
    """(p,) 3 or 4."""
    face: IntArray
    """(p,) index of the input face."""
    dropped: tuple[int, ...]
    """Indices of faces without area."""
    unfaithful: tuple[int, ...]
    """Indices of faces whose triangulation does not have the face's area: they cross themselves."""


def newell_normal(polygons: FloatArray) -> FloatArray:
    """Area-weighted normal (twice the area long) of polygons, (k, n, 3) -> (k, 3), by Newell's method.

    Coordinates are taken relative to the first vertex, so that a polygon far from the origin keeps its
    digits.
    """
    local = polygons - polygons[:, :1]
    following = np.roll(local, -1, axis=1)
    return np.asarray(np.cross(local, following).sum(axis=1))


def split_faces(vertices: Points, faces: tuple[tuple[int, ...], ...], scene_size: float) -> FacePatches:
    """Patches of `faces` over `vertices` (n, 3), whose scene has a diameter of `scene_size` metres."""
    pieces: list[tuple[Corners, IntArray, IntArray]] = []
    dropped: list[int] = []
    unfaithful: list[int] = []
    by_count: dict[int, list[int]] = {}
    for index, face in enumerate(faces):
        by_count.setdefault(len(face), []).append(index)
    for count, members in sorted(by_count.items()):
        ids = np.array(members, dtype=np.int32)
        polygons = vertices[np.array([faces[i] for i in members], dtype=np.int64)]
        alive = _has_area(polygons, scene_size)
        dropped.extend(int(i) for i in ids[~alive])
        polygons, ids = polygons[alive], ids[alive]
        if count == 3:
            pieces.append(_triangles(polygons, ids))
            continue
        simple = np.zeros(len(ids), dtype=bool)
        if count == 4:
            simple = _is_planar(polygons) & _is_convex(polygons)
            quads = polygons[simple]
            pieces.append((quads, np.full(len(quads), 4, dtype=np.int32), ids[simple]))
        for polygon, index in zip(polygons[~simple], ids[~simple], strict=True):
            triangles, faithful = _triangulate(polygon)
            pieces.append(_triangles(triangles, np.full(len(triangles), index, dtype=np.int32)))
            if not faithful:
                unfaithful.append(int(index))
    corners = np.concatenate([piece[0] for piece in pieces] or [np.empty((0, 4, 3))])
    count_of = np.concatenate([piece[1] for piece in pieces] or [np.empty(0, dtype=np.int32)])
    face_of = np.concatenate([piece[2] for piece in pieces] or [np.empty(0, dtype=np.int32)])
    order = np.argsort(face_of, kind="stable")
    return FacePatches(
        corners[order], count_of[order], face_of[order], tuple(sorted(dropped)), tuple(sorted(unfaithful))
    )


def _triangles(polygons: FloatArray, ids: IntArray) -> tuple[Corners, IntArray, IntArray]:
    return polygons[:, [0, 1, 2, 2]], np.full(len(ids), 3, dtype=np.int32), ids


def _diameter(polygons: FloatArray) -> FloatArray:
    extent = polygons.max(axis=1) - polygons.min(axis=1)
    return np.asarray(np.linalg.norm(extent, axis=-1))


def _has_area(polygons: FloatArray, scene_size: float) -> BoolArray:
    diameter = _diameter(polygons)
    area = 0.5 * np.linalg.norm(newell_normal(polygons), axis=-1)
    return np.asarray(
        (area > tolerances.DEGENERATE_AREA * diameter**2)
        & (diameter > tolerances.DEGENERATE_LENGTH * scene_size)
    )


def _is_planar(polygons: FloatArray) -> BoolArray:
    normal = newell_normal(polygons)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    local = polygons - polygons.mean(axis=1, keepdims=True)
    height = np.abs(np.einsum("kni,ki->kn", local, normal)).max(axis=1)
    return np.asarray(height <= tolerances.PLANARITY * _diameter(polygons))


def _is_convex(polygons: FloatArray) -> BoolArray:
    """Whether every corner turns left by more than rounding, seen along the polygon's normal."""
    normal = newell_normal(polygons)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    edge = np.roll(polygons, -1, axis=1) - polygons
    turn = np.cross(np.roll(edge, 1, axis=1), edge)
    signed = np.einsum("kni,ki->kn", turn, normal)
    return np.asarray((signed > tolerances.DEGENERATE_AREA * _diameter(polygons)[:, None] ** 2).all(axis=1))


def _triangulate(polygon: Points) -> tuple[FloatArray, bool]:
    """Triangles (t, 3, 3) of one polygon (n, 3), and whether they have its area."""
    normal = newell_normal(polygon[None])[0]
    length = float(np.linalg.norm(normal))
    normal = normal / length
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(helper, normal)
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    local = polygon - polygon[0]
    flat = np.stack([local @ u, local @ v], axis=-1)
    indices = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32))
    chosen = indices.reshape(-1, 3)
    a, b, c = (flat[chosen[:, k]] for k in range(3))
    doubled = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    chosen = np.where((doubled < 0.0)[:, None], chosen[:, ::-1], chosen)
    chosen = chosen[np.abs(doubled) > 2.0 * tolerances.DEGENERATE_AREA * length]
    faithful = abs(float(np.abs(doubled).sum()) - length) <= 1e-6 * length
    return polygon[chosen], faithful
