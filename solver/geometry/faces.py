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
    smallest: float
    """m, the least diameter of a face that is kept; infinite for none"""
    largest_speck: float
    """m, the greatest diameter of a face that is dropped for its size alone; negative for none"""

    def holds_in(self, scene_size: float) -> bool:
        """Whether these are the patches in a scene with a diameter of `scene_size` metres too."""
        least = tolerances.DEGENERATE_LENGTH * scene_size
        return self.largest_speck <= least < self.smallest


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products (..., 3), as `np.cross`, which takes several times as long over a few vectors."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.subtract(a[..., i] * b[..., j], a[..., j] * b[..., i], out=product[..., k])
    return product


def newell_normal(polygons: FloatArray) -> FloatArray:
    """Area-weighted normal (twice the area long) of polygons, (k, n, 3) -> (k, 3), by Newell's method.

    Coordinates are taken relative to the first vertex, so that a polygon far from the origin keeps its
    digits.
    """
    local = polygons - polygons[:, :1]
    return np.asarray(cross(local, _following(local)).sum(axis=1))


def _following(polygons: FloatArray) -> FloatArray:
    """(k, n, ...) with what follows each corner in its place."""
    return np.concatenate([polygons[:, 1:], polygons[:, :1]], axis=1)


def split_faces(vertices: Points, faces: tuple[tuple[int, ...], ...], scene_size: float) -> FacePatches:
    """Patches of `faces` over `vertices` (n, 3), whose scene has a diameter of `scene_size` metres."""
    pieces: list[tuple[Corners, IntArray, IntArray]] = []
    dropped: list[int] = []
    unfaithful: list[int] = []
    smallest, largest_speck = np.inf, -1.0
    by_count: dict[int, list[int]] = {}
    for index, face in enumerate(faces):
        by_count.setdefault(len(face), []).append(index)
    for count, members in sorted(by_count.items()):
        ids = np.array(members, dtype=np.int32)
        polygons = vertices[np.array([faces[i] for i in members], dtype=np.int64)]
        doubled, diameter = newell_normal(polygons), _diameter(polygons)
        length = np.linalg.norm(doubled, axis=-1)
        has_area = 0.5 * length > tolerances.DEGENERATE_AREA * diameter**2
        is_speck = diameter <= tolerances.DEGENERATE_LENGTH * scene_size
        alive = has_area & ~is_speck
        smallest = float(diameter.min(initial=smallest, where=alive))
        largest_speck = float(diameter.max(initial=largest_speck, where=has_area & is_speck))
        if not alive.all():
            dropped.extend(ids[~alive].tolist())
            polygons, ids = polygons[alive], ids[alive]
            doubled, length, diameter = doubled[alive], length[alive], diameter[alive]
        if count == 3:
            pieces.append(_triangles(polygons, ids))
            continue
        simple = np.zeros(len(ids), dtype=bool)
        if count == 4:
            normal = doubled / length[:, None]
            simple = _is_planar(polygons, normal, diameter) & _is_convex(polygons, normal, diameter)
            quads = polygons[simple]
            pieces.append((quads, np.full(len(quads), 4, dtype=np.int32), ids[simple]))
            if simple.all():
                continue
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
        corners=corners[order],
        corner_count=count_of[order],
        face=face_of[order],
        dropped=tuple(sorted(dropped)),
        unfaithful=tuple(sorted(unfaithful)),
        smallest=smallest,
        largest_speck=largest_speck,
    )


def _triangles(polygons: FloatArray, ids: IntArray) -> tuple[Corners, IntArray, IntArray]:
    return polygons[:, [0, 1, 2, 2]], np.full(len(ids), 3, dtype=np.int32), ids


def _diameter(polygons: FloatArray) -> FloatArray:
    extent = polygons.max(axis=1) - polygons.min(axis=1)
    return np.asarray(np.linalg.norm(extent, axis=-1))


def _is_planar(polygons: FloatArray, normal: FloatArray, diameter: FloatArray) -> BoolArray:
    local = polygons - polygons.mean(axis=1, keepdims=True)
    height = np.abs(np.einsum("kni,ki->kn", local, normal)).max(axis=1)
    return np.asarray(height <= tolerances.PLANARITY * diameter)


def _is_convex(polygons: FloatArray, normal: FloatArray, diameter: FloatArray) -> BoolArray:
    """Whether every corner turns left by more than rounding, seen along the polygon's normal."""
    edge = _following(polygons) - polygons
    turn = cross(edge, _following(edge))
    signed = np.einsum("kni,ki->kn", turn, normal)
    return np.asarray((signed > tolerances.DEGENERATE_AREA * diameter[:, None] ** 2).all(axis=1))


def _triangulate(polygon: Points) -> tuple[FloatArray, bool]:
    """Triangles (t, 3, 3) of one polygon (n, 3), and whether they have its area."""
    normal = newell_normal(polygon[None])[0]
    length = float(np.linalg.norm(normal))
    normal = normal / length
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    u = cross(helper, normal)
    u /= np.linalg.norm(u)
    v = cross(normal, u)
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
