"""What one object gives to a flattened scene, kept for as long as the object itself.

Objects do not change, and revisions of a scene share those that no edit has touched: only what is new in a
revision is split into patches. A scene has a say in the patches of its objects by its size alone, which
decides what is too small to be a face; a part is kept while that decision stays the same, so that it is bit
by bit what would be made anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np

from solver.geometry.faces import FacePatches, cross, split_faces
from solver.geometry.scene import Material, SceneObject
from solver.types import Corners, FloatArray, Int64Array, IntArray, ObjectId, Vector


@dataclass(frozen=True, eq=False)
class Part:
    """The fields of `Surfaces` over the patches and triangles of one object."""

    corners: Corners
    corner_count: IntArray
    normal: FloatArray
    area: FloatArray
    face: IntArray
    side: IntArray
    reflectance: FloatArray
    emission: FloatArray
    specular: FloatArray
    exponent: FloatArray
    emission_exponent: FloatArray
    triangles: FloatArray
    triangle_patch: IntArray
    """(t, 2) patches counted from the object's first"""
    face_count: int
    warnings: tuple[str, ...]


_PARTS: Final[WeakKeyDictionary[SceneObject, tuple[FacePatches, Part]]] = WeakKeyDictionary()
_EXTENTS: Final[WeakKeyDictionary[SceneObject, tuple[Vector, Vector]]] = WeakKeyDictionary()


def part_of(source: SceneObject, scene_size: float) -> Part:
    """The part of `source` in a scene with a diameter of `scene_size` metres."""
    kept = _PARTS.get(source)
    if kept is None or not kept[0].holds_in(scene_size):
        kept = _PARTS[source] = _make_part(source, scene_size)
    return kept[1]


def extent(source: SceneObject) -> tuple[Vector, Vector] | None:
    """Least and greatest metres (3,) of the vertices that faces of `source` use; None without faces."""
    if not source.mesh.faces:
        return None
    kept = _EXTENTS.get(source)
    if kept is None:
        used = source.world_vertices[sorted({i for face in source.mesh.faces for i in face})]
        kept = _EXTENTS[source] = (used.min(axis=0), used.max(axis=0))
    return kept


def _make_part(source: SceneObject, scene_size: float) -> tuple[FacePatches, Part]:
    faces = source.mesh.faces
    if source.transform.mirrors:
        faces = tuple(face[::-1] for face in faces)
    split = split_faces(source.world_vertices, faces, scene_size)
    told = _warnings(source.id, split.dropped, split.unfaithful)
    kept = len(faces) - len(split.dropped)
    return split, _assemble(source.material, split.corners, split.corner_count, split.face, kept, told)


def cut_part(source: SceneObject, part: Part, left: Mapping[int, tuple[Corners, IntArray]]) -> Part:
    """The part of `source` with fronts (keys of `left`) cut to pieces: corners (m, 4, 3), and how many (m,).

    Faces that are cut away as a whole count as accepted all the same.
    """
    p = len(part.face) // (2 if source.material.two_sided else 1)
    pieces = [left.get(k, (part.corners[k : k + 1], part.corner_count[k : k + 1])) for k in range(p)]
    face = np.repeat(part.face[:p], [len(counts) for _, counts in pieces])
    faces = len(np.unique(part.face[list(left)]))
    told = f"object {source.id!r}: {_count(faces)} cut to what no other face in the same place covers"
    return _assemble(
        source.material,
        np.concatenate([corners for corners, _ in pieces]),
        np.concatenate([counts for _, counts in pieces]),
        face,
        part.face_count,
        (*part.warnings, told),
    )


def _assemble(
    material: Material,
    corners: Corners,
    count: IntArray,
    face: IntArray,
    face_count: int,
    warnings: tuple[str, ...],
) -> Part:
    p = len(count)
    is_triangle = count == 3
    # A triangle repeats its last corner, with which the product of diagonals would do, but for rounding.
    doubled = np.where(
        is_triangle[:, None],
        cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
        cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]),
    )
    length = np.linalg.norm(doubled, axis=-1)
    normal, area = doubled / length[:, None], 0.5 * length
    triangles, owner = _opaque_triangles(corners, count)
    back = np.full(len(owner), -1, dtype=np.int32)
    side = np.zeros(p, dtype=np.int32)
    if material.two_sided:
        reverse = np.where(is_triangle[:, None], [[2, 1, 0, 0]], [[3, 2, 1, 0]])
        corners = np.concatenate([corners, np.take_along_axis(corners, reverse[:, :, None], axis=1)])
        count, area = np.concatenate([count, count]), np.concatenate([area, area])
        normal, face = np.concatenate([normal, -normal]), np.concatenate([face, face])
        side = np.repeat(np.array([0, 1], dtype=np.int32), p)
        back = owner + np.int32(p)
    total = len(count)
    return Part(
        corners=corners,
        corner_count=count,
        normal=normal,
        area=area,
        face=face,
        side=side,
        reflectance=np.tile(material.reflectance, (total, 1)),
        emission=np.tile(material.emission, (total, 1)),
        specular=np.tile(material.specular, (total, 1)),
        exponent=np.full(total, material.exponent, dtype=np.float64),
        emission_exponent=np.full(total, material.emission_exponent, dtype=np.float64),
        triangles=triangles,
        triangle_patch=np.stack([owner, back], axis=-1),
        face_count=face_count,
        warnings=warnings,
    )


def _opaque_triangles(corners: Corners, count: IntArray) -> tuple[FloatArray, IntArray]:
    """Triangles (t, 3, 3) of the patches, and the patch of each; a quadrilateral gives two."""
    first: Int64Array = np.arange(len(count))
    second = np.flatnonzero(count == 4)
    triangles = np.concatenate([corners[:, :3], corners[second][:, [0, 2, 3]]])
    return triangles, np.concatenate([first, second]).astype(np.int32)


def _warnings(object_id: ObjectId, dropped: Sequence[int], unfaithful: Sequence[int]) -> tuple[str, ...]:
    told = []
    if dropped:
        told.append(
            f"object {object_id!r}: {_count(len(dropped))} of zero area dropped (first: {dropped[0]})"
        )
    if unfaithful:
        told.append(
            f"object {object_id!r}: {_count(len(unfaithful))} crossing itself, triangulated approximately "
            f"(first: {unfaithful[0]})"
        )
    return tuple(told)


def _count(n: int) -> str:
    return f"{n} face" if n == 1 else f"{n} faces"
