"""The immutable scene: objects with mesh, material and transform, and the cameras that look at them.

Every edit returns a new `Scene`; unchanged objects are shared by identity, so that two revisions can
be compared object by object at no cost.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from solver.errors import DuplicateObjectError, UnknownObjectError
from solver.geometry.transform import Transform
from solver.types import FloatArray, ObjectId, Points, Vector


@dataclass(frozen=True, eq=False)
class Material:
    """What a surface makes of light: diffuse, and specular where it says so."""

    reflectance: Vector
    """(3,) hemispherical diffuse reflectance, each in [0, 1)."""
    emission: Vector
    """(3,) emitted radiant exitance in W/m2."""
    two_sided: bool = False
    """Whether the back reflects and emits too; otherwise it is black."""
    specular: Vector = field(default_factory=lambda: np.zeros(3))
    """(3,) hemispherical specular reflectance, each in [0, 1), and below 1 with `reflectance`."""
    exponent: float = math.inf
    """Phong exponent of the lobe that specular reflection goes into; infinite for a perfect mirror."""
    emission_exponent: float = 0.0
    """d of emitted radiance that goes with cos^d of the angle to the normal; 0 is diffuse."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Polygons over shared vertices, in the object's own frame."""

    vertices: Points
    """(n, 3) metres."""
    faces: tuple[tuple[int, ...], ...]
    """Vertex indices of each polygon, counter-clockwise seen from its front; may be concave."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """A mesh placed in the world."""

    id: ObjectId
    mesh: Mesh
    material: Material
    transform: Transform = field(default_factory=Transform.identity)

    @cached_property
    def world_vertices(self) -> Points:
        """(n, 3) vertices in the world frame, metres."""
        return self.transform.apply(self.mesh.vertices)


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera."""

    eye: Vector
    target: Vector
    up: Vector
    vertical_fov: float
    """Full vertical angle of view in degrees."""
    width: int
    height: int

    def basis(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Unit right, up and forward vectors, each (3,)."""
        forward = self.target - self.eye
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right = right / np.linalg.norm(right)
        return right, np.cross(right, forward), forward


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects by id, in the order in which they were added, and cameras by name."""

    objects: Mapping[ObjectId, SceneObject]
    cameras: Mapping[str, Camera] = field(default_factory=dict)
    name: str = ""
    luminous_efficacy: float = 179.0
    """Lumens per watt: photometric values are this times the luminance of the radiometric triple."""
    notes: tuple[str, ...] = ()
    """What a user should know of where the scene has come from."""

    def __iter__(self) -> Iterator[SceneObject]:
        return iter(self.objects.values())

    def with_object(self, added: SceneObject) -> Scene:
        """This scene and `added`. Raises DuplicateObjectError."""
        if added.id in self.objects:
            raise DuplicateObjectError(added.id)
        return replace(self, objects={**self.objects, added.id: added})

    def without_object(self, object_id: ObjectId) -> Scene:
        """This scene less one object. Raises UnknownObjectError."""
        self.object(object_id)
        return replace(self, objects={key: o for key, o in self.objects.items() if key != object_id})

    def with_replaced(self, changed: SceneObject) -> Scene:
        """This scene with the object of the same id replaced in place. Raises UnknownObjectError."""
        self.object(changed.id)
        return replace(self, objects={**self.objects, changed.id: changed})

    def object(self, object_id: ObjectId) -> SceneObject:
        """The object of that id. Raises UnknownObjectError."""
        found = self.objects.get(object_id)
        if found is None:
            raise UnknownObjectError(object_id)
        return found
