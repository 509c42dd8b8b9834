"""A scene flattened into arrays: the one-sided convex patches that carry light, and the opaque triangles.

Every accepted face gives one or more patches; with a two-sided material each patch comes twice, front
and back, with opposite winding. Blocking needs each face once: `triangles` hold it, and the front
patches (`side == 0`) are the polygons that shafts are tested against.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver.geometry.faces import split_faces
from solver.geometry.scene import Scene, SceneObject
from solver.types import Corners, FloatArray, Int64Array, IntArray, ObjectId, Vector


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Structs of arrays over p patches and t triangles, in world metres."""

    object_ids: tuple[ObjectId, ...]
    corners: Corners
    """(p, 4, 3)"""
    corner_count: IntArray
    """(p,) 3 or 4"""
    normal: FloatArray
    """(p, 3) unit, on the side that reflects and emits"""
    area: FloatArray
    """(p,) m2"""
    face: IntArray
    """(p,) index of the input face in its object"""
    object: IntArray
    """(p,) index into `object_ids`"""
    side: IntArray
    """(p,) 0 for the front of a face, 1 for the back of a two-sided one"""
    reflectance: FloatArray
    """(p, 3)"""
    emission: FloatArray
    """(p, 3) W/m2"""
    specular: FloatArray
    """(p, 3) hemispherical specular reflectance"""
    exponent: FloatArray
    """(p,) of the Phong lobe of specular reflection, infinite for a perfect mirror"""
    emission_exponent: FloatArray
    """(p,) d of emitted radiance that goes with cos^d of the angle to the normal"""
    triangles: FloatArray
    """(t, 3, 3) opaque triangles, each face once"""
    triangle_patch: IntArray
    """(t, 2) patch seen from the front and from the back of each triangle; -1 where that side is black"""
    center: Vector
    """(3,) middle of the bounding box"""
    size: float
    """Length of the bounding box's diagonal, metres"""
    face_count: int
    """Accepted faces"""
    warnings: tuple[str, ...]

    @property
    def patch_count(self) -> int:
        """Number of patches."""
        return len(self.area)

    @property
    def is_grey(self) -> bool:
        """Whether one channel tells all: reflectances and emission are equal over R, G and B."""
        triples = (self.reflectance, self.emission, self.specular)
        return all(bool(np.all(triple == triple[:, :1])) for triple in triples)

    @property
    def has_specular(self) -> bool:
        """Whether anything reflects specularly."""
        return bool(self.specular.any())

    @property
    def has_directional_emission(self) -> bool:
        """Whether anything emits otherwise than diffusely."""
        return bool(np.any(self.emission.any(axis=1) & (self.emission_exponent > 0.0)))


def flatten(scene: Scene) -> Surfaces:
    """The surfaces of `scene`; degenerate faces are dropped with a warning."""
    objects = list(scene)
    center, size = _bounds(objects)
    parts = [_flatten_object(o, index, size) for index, o in enumerate(objects)]
    warnings = [warning for part in parts for warning in part.warnings]
    start = np.cumsum([0] + [len(part.area) for part in parts])
    return Surfaces(
        object_ids=tuple(o.id for o in objects),
        corners=_join([part.corners for part in parts], (0, 4, 3)),
        corner_count=_join_ids([part.corner_count for part in parts]),
        normal=_join([part.normal for part in parts], (0, 3)),
        area=_join([part.area for part in parts], (0,)),
        face=_join_ids([part.face for part in parts]),
        object=_join_ids([part.object for part in parts]),
        side=_join_ids([part.side for part in parts]),
        reflectance=_join([part.reflectance for part in parts], (0, 3)),
        emission=_join([part.emission for part in parts], (0, 3)),
        specular=_join([part.specular for part in parts], (0, 3)),
        exponent=_join([part.exponent for part in parts], (0,)),
        emission_exponent=_join([part.emission_exponent for part in parts], (0,)),
        triangles=_join([part.triangles for part in parts], (0, 3, 3)),
        triangle_patch=np.concatenate(
            [
                np.where(part.triangle_patch >= 0, part.triangle_patch + np.int32(first), np.int32(-1))
                for part, first in zip(parts, start[:-1], strict=True)
            ]
            or [np.empty((0, 2), dtype=np.int32)]
        ).astype(np.int32),
        center=center,
        size=size,
        face_count=sum(part.face_count for part in parts),
        warnings=tuple(warnings),
    )


def _bounds(objects: Sequence[SceneObject]) -> tuple[Vector, float]:
    used = [
        o.world_vertices[sorted({i for face in o.mesh.faces for i in face})] for o in objects if o.mesh.faces
    ]
    if not used:
        return np.zeros(3), 1.0
    low = np.min([v.min(axis=0) for v in used], axis=0)
    high = np.max([v.max(axis=0) for v in used], axis=0)
    size = float(np.linalg.norm(high - low))
    return 0.5 * (low + high), size if size > 0.0 else 1.0


@dataclass(frozen=True, eq=False)
class _Part:
    corners: Corners
    corner_count: IntArray
    normal: FloatArray
    area: FloatArray
    face: IntArray
    object: IntArray
    side: IntArray
    reflectance: FloatArray
    emission: FloatArray
    specular: FloatArray
    exponent: FloatArray
    emission_exponent: FloatArray
    triangles: FloatArray
    triangle_patch: IntArray
    face_count: int
    warnings: tuple[str, ...]


def _flatten_object(source: SceneObject, index: int, scene_size: float) -> _Part:
    faces = source.mesh.faces
    if source.transform.mirrors:
        faces = tuple(face[::-1] for face in faces)
    split = split_faces(source.world_vertices, faces, scene_size)
    corners, count = split.corners, split.corner_count
    p = len(count)
    doubled = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    is_triangle = count == 3
    doubled[is_triangle] = np.cross(
        corners[is_triangle, 1] - corners[is_triangle, 0], corners[is_triangle, 2] - corners[is_triangle, 0]
    )
    length = np.linalg.norm(doubled, axis=-1)
    normal, area = doubled / length[:, None], 0.5 * length
    triangles, owner = _opaque_triangles(corners, count)
    back = np.full(len(owner), -1, dtype=np.int32)
    face, side = split.face, np.zeros(p, dtype=np.int32)
    if source.material.two_sided:
        reverse = np.where(is_triangle[:, None], [[2, 1, 0, 0]], [[3, 2, 1, 0]])
        corners = np.concatenate([corners, np.take_along_axis(corners, reverse[:, :, None], axis=1)])
        count, area = np.concatenate([count, count]), np.concatenate([area, area])
        normal, face = np.concatenate([normal, -normal]), np.concatenate([face, face])
        side = np.repeat(np.array([0, 1], dtype=np.int32), p)
        back = owner + np.int32(p)
    total = len(count)
    return _Part(
        corners=corners,
        corner_count=count,
        normal=normal,
        area=area,
        face=face,
        object=np.full(total, index, dtype=np.int32),
        side=side,
        reflectance=np.tile(source.material.reflectance, (total, 1)),
        emission=np.tile(source.material.emission, (total, 1)),
        specular=np.tile(source.material.specular, (total, 1)),
        exponent=np.full(total, source.material.exponent, dtype=np.float64),
        emission_exponent=np.full(total, source.material.emission_exponent, dtype=np.float64),
        triangles=triangles,
        triangle_patch=np.stack([owner, back], axis=-1),
        face_count=len(faces) - len(split.dropped),
        warnings=_warnings(source.id, split.dropped, split.unfaithful),
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


def _join(parts: list[FloatArray], empty: tuple[int, ...]) -> FloatArray:
    return np.concatenate(parts) if parts else np.empty(empty)


def _join_ids(parts: list[IntArray]) -> IntArray:
    return np.concatenate(parts).astype(np.int32) if parts else np.empty(0, dtype=np.int32)
