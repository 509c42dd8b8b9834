"""A scene flattened into arrays: the one-sided convex patches that carry light, and the opaque triangles.

Every accepted face gives one or more patches; with a two-sided material each patch comes twice, front
and back, with opposite winding. Blocking needs each face once: `triangles` hold it, and the front
patches (`side == 0`) are the polygons that shafts are tested against.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver import tolerances
from solver.geometry.overlaps import cut_covered, find_covers
from solver.geometry.parts import Part, cut_part, extent, part_of
from solver.geometry.scene import Scene, SceneObject
from solver.types import Corners, FloatArray, IntArray, ObjectId, Vector


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

    in_colour: bool = False
    """Whether light is to be told in three channels even where all are equal"""

    @property
    def patch_count(self) -> int:
        """Number of patches."""
        return len(self.area)

    @property
    def is_grey(self) -> bool:
        """Whether one channel tells all: reflectances and emission are equal over R, G and B."""
        if self.in_colour:
            return False
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
    """The surfaces of `scene`; degenerate faces are dropped with a warning.

    Of objects that were in an earlier scene too, what they gave to that is taken over.
    """
    objects = list(scene)
    center, size = _bounds(objects)
    parts = _uncovered(objects, [part_of(o, size) for o in objects], center, size)
    counts = np.array([len(part.area) for part in parts], dtype=np.int64)
    # Triangles name patches of their own object, or none.
    first = np.repeat(np.cumsum(counts) - counts, [len(part.triangles) for part in parts])[:, None]
    local = _join_ids([part.triangle_patch for part in parts], (0, 2))
    return Surfaces(
        object_ids=tuple(o.id for o in objects),
        corners=_join([part.corners for part in parts], (0, 4, 3)),
        corner_count=_join_ids([part.corner_count for part in parts], (0,)),
        normal=_join([part.normal for part in parts], (0, 3)),
        area=_join([part.area for part in parts], (0,)),
        face=_join_ids([part.face for part in parts], (0,)),
        object=np.repeat(np.arange(len(parts), dtype=np.int32), counts),
        side=_join_ids([part.side for part in parts], (0,)),
        reflectance=_join([part.reflectance for part in parts], (0, 3)),
        emission=_join([part.emission for part in parts], (0, 3)),
        specular=_join([part.specular for part in parts], (0, 3)),
        exponent=_join([part.exponent for part in parts], (0,)),
        emission_exponent=_join([part.emission_exponent for part in parts], (0,)),
        triangles=_join([part.triangles for part in parts], (0, 3, 3)),
        triangle_patch=np.where(local >= 0, local + first, -1).astype(np.int32),
        center=center,
        size=size,
        face_count=sum(part.face_count for part in parts),
        warnings=tuple(warning for part in parts for warning in part.warnings),
    )


def _uncovered(objects: Sequence[SceneObject], parts: list[Part], center: Vector, size: float) -> list[Part]:
    """The parts, without what lies beneath other faces in the same place."""
    fronts = [int(np.count_nonzero(part.side == 0)) for part in parts]
    shown = list(zip(parts, fronts, strict=True))
    corners = _join([part.corners[:n] for part, n in shown], (0, 4, 3))
    counts = _join_ids([part.corner_count[:n] for part, n in shown], (0,))
    normals = _join([part.normal[:n] for part, n in shown], (0, 3))
    two_sided = np.repeat([o.material.two_sided for o in objects], fronts).astype(np.bool_)
    covered, cover = find_covers(corners, counts, normals, two_sided, center, size)
    if len(covered) == 0:
        return parts
    left = cut_covered(corners, counts, normals, covered, cover, tolerances.TOUCH * size)
    first = 0
    for k, (part, n) in enumerate(shown):
        own = {face - first: pieces for face, pieces in left.items() if first <= face < first + n}
        if own:
            parts[k] = cut_part(objects[k], part, own)
        first += n
    return parts


def _bounds(objects: Sequence[SceneObject]) -> tuple[Vector, float]:
    extents = [found for o in objects if (found := extent(o)) is not None]
    if not extents:
        return np.zeros(3), 1.0
    low = np.min([least for least, _ in extents], axis=0)
    high = np.max([greatest for _, greatest in extents], axis=0)
    size = float(np.linalg.norm(high - low))
    return 0.5 * (low + high), size if size > 0.0 else 1.0


def _join(parts: list[FloatArray], empty: tuple[int, ...]) -> FloatArray:
    return np.concatenate(parts) if parts else np.empty(empty)


def _join_ids(parts: list[IntArray], empty: tuple[int, ...]) -> IntArray:
    return np.concatenate(parts) if parts else np.empty(empty, dtype=np.int32)
