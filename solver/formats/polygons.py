"""Polygons out of triangles: those that lie side by side in one plane become one face.

Formats that hold triangles alone have cut every wall in two or more. What is told apart by the cut is only
work: a patch more is a link more to every other. A flat piece whose border is one ring becomes that ring,
less the corners where it goes straight on; where its triangles, taken two by two as convex
quadrilaterals, make fewer patches, it becomes those.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from solver import tolerances
from solver.document.fields import MAX_FACE_CORNERS
from solver.geometry.faces import cross, newell_normal
from solver.types import BoolArray, FloatArray, Int64Array, Points

Face = tuple[int, ...]

_STRAIGHT: Final = tolerances.PLANARITY
"""Sine of the turn of a border that goes straight on, at most."""


def weld(vertices: Points, faces: Sequence[Sequence[int]]) -> tuple[Points, list[Face]]:
    """The vertices that faces use, each place once, and the faces over them.

    Corners that fall together with the one before are left out, and faces that have fewer than three then.
    """
    used, inverse = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    number = inverse.ravel().tolist()
    welded: list[Face] = []
    for face in faces:
        ring = [number[corner] for corner in face]
        ring = [corner for k, corner in enumerate(ring) if corner != ring[k - 1]]
        if len(ring) >= 3:
            welded.append(tuple(ring))
    kept = np.unique(np.array([corner for face in welded for corner in face], dtype=np.int64))
    place = np.zeros(len(used), dtype=np.int64)
    place[kept] = np.arange(len(kept))
    renumbered = place.tolist()
    return used[kept], [tuple(renumbered[corner] for corner in face) for face in welded]


def merge_triangles(vertices: Points, faces: Sequence[Face]) -> list[Face]:
    """`faces` over welded vertices (n, 3), with triangles side by side in one plane made one polygon.

    Faces of more corners stay as they are, and come first.
    """
    kept = [face for face in faces if len(face) != 3]
    triangles = np.array([face for face in faces if len(face) == 3], dtype=np.int64).reshape(-1, 3)
    if len(triangles) < 2:
        return list(faces)
    pairs, shared = _neighbours(triangles)
    level = _are_level(vertices, triangles, pairs)
    pairs, shared = pairs[level], shared[level]
    quads = _quads(triangles, pairs, shared)
    worth = _squareness(vertices, quads)
    for members, within in _pieces(len(triangles), pairs):
        if len(members) == 1:
            kept.append(_face(triangles[members[0]]))
            continue
        ring = _ring(vertices, triangles[members])
        paired = _paired(triangles, members, pairs[within], quads[within], worth[within])
        kept.extend(paired if ring is None or _patches(vertices, ring) > len(paired) else [ring])
    return kept


def _face(corners: Int64Array) -> Face:
    return tuple(corners.tolist())


def _neighbours(triangles: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Pairs (m, 2) of triangles on two sides of an edge that no third has, and its first corners (m, 2).

    The edge is run through one way by the first and the other way by the second: column k of the corners is
    the place, 0 to 2, at which the edge begins in the k-th of the pair.
    """
    start, end = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    most = int(triangles.max()) + 1
    there, back = start * most + end, end * most + start
    order = np.argsort(there, kind="stable")
    ranked = there[order]
    at = np.searchsorted(ranked, back)
    last = np.searchsorted(ranked, back, side="right")
    twin = np.where(last - at == 1, order[np.minimum(at, len(order) - 1)], -1)
    edge = np.flatnonzero(twin >= 0)
    edge = edge[twin[twin[edge]] == edge]
    edge = edge[edge < twin[edge]]
    other = twin[edge]
    return np.stack([edge // 3, other // 3], axis=1), np.stack([edge % 3, other % 3], axis=1)


def _are_level(vertices: Points, triangles: Int64Array, pairs: Int64Array) -> BoolArray:
    """(m,) whether two triangles look the same way and lie in one plane, as a face may."""
    places = vertices[triangles]
    normal = cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    length = np.linalg.norm(normal, axis=1)
    extent = np.ptp(places, axis=1)
    sound = length > 2.0 * tolerances.DEGENERATE_AREA * (extent**2).sum(axis=1)
    unit = normal / np.where(sound, length, 1.0)[:, None]
    a, b = pairs[:, 0], pairs[:, 1]
    both = np.concatenate([places[a], places[b]], axis=1)
    diameter = np.linalg.norm(np.ptp(both, axis=1), axis=1)
    height = np.abs(np.einsum("mkc,mc->mk", both - both[:, :1], unit[a])).max(axis=1, initial=0.0)
    lower = np.abs(np.einsum("mkc,mc->mk", both - both[:, 3:4], unit[b])).max(axis=1, initial=0.0)
    alike = np.einsum("mc,mc->m", unit[a], unit[b]) > 0.0
    flat = np.maximum(height, lower) <= tolerances.PLANARITY * diameter
    return np.asarray(sound[a] & sound[b] & alike & flat)


def _quads(triangles: Int64Array, pairs: Int64Array, shared: Int64Array) -> Int64Array:
    """(m, 4) corners of the two triangles of each pair together."""
    first, second = triangles[pairs[:, 0]], triangles[pairs[:, 1]]
    row = np.arange(len(pairs))
    start, end = first[row, shared[:, 0]], first[row, (shared[:, 0] + 1) % 3]
    opposite = first[row, (shared[:, 0] + 2) % 3]
    across = second[row, (shared[:, 1] + 2) % 3]
    return np.stack([end, opposite, start, across], axis=1)


def _squareness(vertices: Points, quads: Int64Array) -> FloatArray:
    """(m,) least sine of the corners' turns; at most `_STRAIGHT` where a quadrilateral is not convex."""
    places = vertices[quads]
    side = np.roll(places, -1, axis=1) - places
    length = np.linalg.norm(side, axis=2)
    normal = newell_normal(places) if len(quads) else np.zeros((0, 3))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    turn = np.einsum("mkc,mc->mk", cross(side, np.roll(side, -1, axis=1)), normal)
    scale = np.maximum(length * np.roll(length, -1, axis=1), 1e-300)
    return np.asarray((turn / scale).min(axis=1, initial=1.0))


def _pieces(count: int, pairs: Int64Array) -> list[tuple[list[int], list[int]]]:
    """The triangles that hang together, and which pairs are among them."""
    parent = list(range(count))

    def root(of: int) -> int:
        while parent[of] != of:
            parent[of] = parent[parent[of]]
            of = parent[of]
        return of

    for a, b in pairs.tolist():
        parent[root(a)] = root(b)
    pieces: dict[int, tuple[list[int], list[int]]] = {}
    for triangle in range(count):
        pieces.setdefault(root(triangle), ([], []))[0].append(triangle)
    for pair, (a, _) in enumerate(pairs.tolist()):
        pieces[root(a)][1].append(pair)
    return list(pieces.values())


def _ring(vertices: Points, triangles: Int64Array) -> Face | None:
    """The border of some triangles, without the corners where it goes straight on.

    None where it is not one ring that comes by each corner once, or they do not lie in one plane.
    """
    edges = list(zip(triangles.ravel().tolist(), triangles[:, [1, 2, 0]].ravel().tolist(), strict=True))
    inner = set(edges)
    border = [(a, b) for a, b in edges if (b, a) not in inner]
    following = dict(border)
    if len(following) != len(border) or len(set(following.values())) != len(border) or not border:
        return None
    ring = [border[0][0]]
    while (corner := following[ring[-1]]) != ring[0]:
        ring.append(corner)
        if len(ring) > len(border):
            return None
    if len(ring) != len(border) or not _is_flat(vertices[ring]):
        return None
    places = vertices[ring]
    before, after = places - np.roll(places, 1, axis=0), np.roll(places, -1, axis=0) - places
    bend = np.linalg.norm(cross(before, after), axis=1)
    scale = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    turns = (bend > _STRAIGHT * scale) | (np.einsum("kc,kc->k", before, after) < 0.0)
    found = tuple(corner for corner, is_corner in zip(ring, turns.tolist(), strict=True) if is_corner)
    return found if 3 <= len(found) <= MAX_FACE_CORNERS else None


def _is_flat(places: Points) -> bool:
    normal = newell_normal(places[None])[0]
    length = float(np.linalg.norm(normal))
    diameter = float(np.linalg.norm(np.ptp(places, axis=0)))
    if length <= 2.0 * tolerances.DEGENERATE_AREA * diameter**2:
        return False
    height = np.abs((places - places.mean(axis=0)) @ (normal / length)).max()
    return bool(height <= tolerances.PLANARITY * diameter)


def _patches(vertices: Points, ring: Face) -> int:
    """Patches that a face of these corners will be made of."""
    if len(ring) == 4 and _squareness(vertices, np.array([ring]))[0] > _STRAIGHT:
        return 1
    return len(ring) - 2


def _paired(
    triangles: Int64Array, members: list[int], pairs: Int64Array, quads: Int64Array, worth: FloatArray
) -> list[Face]:
    """Triangles taken two by two, the squarest first, and those that are left over."""
    alone = set(members)
    found: list[Face] = []
    for pair in np.argsort(-worth, kind="stable").tolist():
        a, b = pairs[pair].tolist()
        if worth[pair] <= _STRAIGHT:
            break
        if a in alone and b in alone:
            alone -= {a, b}
            found.append(_face(quads[pair]))
    return found + [_face(triangles[triangle]) for triangle in sorted(alone)]
