"""Documents to scenes and back: what relates one field to another is checked here.

Every error is a SceneError whose location is the path of the offending field in the document.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from solver import tolerances
from solver.document.fields import LEAST_LENGTH, MAX_COORDINATE, Location
from solver.document.framing import middle, overview
from solver.document.models import (
    CameraDocument,
    MaterialDocument,
    MeshDocument,
    ObjectDocument,
    SceneDocument,
    TransformDocument,
)
from solver.errors import DuplicateObjectError, SceneError
from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.geometry.transform import Transform
from solver.types import Vector

DEFAULT_CAMERA: Final = "main"
_Y: Final = np.array([0.0, 1.0, 0.0])
_Z: Final = np.array([0.0, 0.0, 1.0])


def scene_of(document: SceneDocument) -> Scene:
    """The scene that `document` describes. Raises SceneError."""
    objects: dict[str, SceneObject] = {}
    for index, entry in enumerate(document.objects):
        where: Location = ("objects", index)
        if entry.id in objects:
            raise DuplicateObjectError(entry.id, (*where, "id"))
        objects[entry.id] = object_of(entry, where)
    scene = Scene(
        objects=objects,
        name=document.name,
        luminous_efficacy=document.luminous_efficacy,
        notes=tuple(document.notes),
    )
    cameras = document.cameras or {DEFAULT_CAMERA: CameraDocument()}
    seen = {name: camera_of(camera, scene, ("cameras", name)) for name, camera in cameras.items()}
    return replace(scene, cameras=seen)


def object_of(document: ObjectDocument, where: Location = ()) -> SceneObject:
    """The object that `document`, found at `where`, describes. Raises SceneError."""
    placed = SceneObject(
        id=document.id,
        mesh=mesh_of(document.mesh, (*where, "mesh")),
        material=material_of(document.material, (*where, "material")),
        transform=transform_of(document.transform),
    )
    require_in_bounds(placed, (*where, "transform"))
    return placed


def mesh_of(document: MeshDocument, where: Location = ()) -> Mesh:
    """The mesh that `document` describes. Raises SceneError where a face names a vertex that is not there."""
    vertices = np.array(document.vertices, dtype=np.float64).reshape(-1, 3)
    faces = tuple(tuple(face) for face in document.faces)
    if faces and max(max(face) for face in faces) >= len(vertices):
        _refuse_index(faces, len(vertices), where)
    return Mesh(vertices, faces)


def _refuse_index(faces: tuple[tuple[int, ...], ...], count: int, where: Location) -> None:
    at, face = next((at, face) for at, face in enumerate(faces) if max(face) >= count)
    corner = next(corner for corner, index in enumerate(face) if index >= count)
    raise SceneError(
        f"there is no vertex {face[corner]}: the mesh has {count}, numbered from 0",
        (*where, "faces", at, corner),
    )


def material_of(document: MaterialDocument, where: Location = ()) -> Material:
    """The material that `document` describes. Raises SceneError where it would reflect all light, or more."""
    for channel, (diffuse, specular) in enumerate(zip(document.reflectance, document.specular, strict=True)):
        if diffuse + specular >= 1.0:
            raise SceneError(
                f"reflectance + specular must be below 1, and {diffuse:g} + {specular:g} is not",
                (*where, "specular", channel),
            )
    return Material(
        reflectance=np.array(document.reflectance),
        emission=np.array(document.emission),
        two_sided=document.two_sided,
        specular=np.array(document.specular),
        exponent=math.inf if document.exponent is None else document.exponent,
        emission_exponent=document.emission_exponent,
    )


def transform_of(document: TransformDocument) -> Transform:
    """The transform that `document` describes."""
    if document.matrix is not None:
        return Transform(np.array(document.matrix).reshape(4, 4))
    return Transform.from_parts(
        np.array(document.translation), np.array(document.rotation), np.array(document.scale)
    )


def require_in_bounds(placed: SceneObject, where: Location) -> None:
    """Raise SceneError where the world coordinates of an object leave the range that a document may hold."""
    if np.abs(placed.world_vertices).max(initial=0.0) > MAX_COORDINATE:
        raise SceneError(f"the transform takes vertices beyond {MAX_COORDINATE:g} m", where)


def camera_of(document: CameraDocument, scene: Scene, where: Location = ()) -> Camera:
    """The camera that `document` describes, its missing parts chosen to show `scene`. Raises SceneError."""
    if document.eye is None:
        eye, target = overview(scene, document.vertical_fov, document.width / document.height)
    else:
        eye, target = np.array(document.eye), middle(scene)
    if document.target is not None:
        target = np.array(document.target)
    return Camera(
        eye=eye,
        target=target,
        up=up_of(eye, target, document.up, where),
        vertical_fov=document.vertical_fov,
        width=document.width,
        height=document.height,
    )


def up_of(eye: Vector, target: Vector, up: Sequence[float] | None, where: Location = ()) -> Vector:
    """(3,) up direction of a camera at `eye` that looks at `target`: `up`, or by default z or y.

    Raises SceneError where there is no direction to look in, or it is along `up`.
    """
    if np.abs(target - eye).max() < LEAST_LENGTH:
        raise SceneError("the target is where the eye is", (*where, "target"))
    if up is None:
        return _Z if not is_parallel(target - eye, _Z) else _Y
    if is_parallel(target - eye, np.array(up)):
        raise SceneError("the camera looks along its up direction", (*where, "up"))
    return np.array(up)


def is_parallel(a: Vector, b: Vector) -> bool:
    """Whether two vectors (3,) lie along one line, either way, within rounding."""
    return bool(np.linalg.norm(np.cross(a, b)) <= tolerances.SIDE * np.linalg.norm(a) * np.linalg.norm(b))


def document_of(scene: Scene) -> SceneDocument:
    """The document of `scene`: the fields that are set, posted back, give an equal scene, to the last bit."""
    return SceneDocument(
        name=scene.name,
        luminous_efficacy=scene.luminous_efficacy,
        objects=[_object_document(o) for o in scene],
        cameras={name: _camera_document(camera) for name, camera in scene.cameras.items()},
        **({"notes": list(scene.notes)} if scene.notes else {}),
    )


def _object_document(source: SceneObject) -> ObjectDocument:
    return ObjectDocument(
        id=source.id,
        mesh=MeshDocument(
            vertices=source.mesh.vertices.tolist(), faces=[list(face) for face in source.mesh.faces]
        ),
        material=_material_document(source.material),
        transform=_transform_document(source.transform),
    )


def _material_document(source: Material) -> MaterialDocument:
    return MaterialDocument(
        reflectance=source.reflectance.tolist(),
        emission=source.emission.tolist(),
        specular=source.specular.tolist(),
        exponent=None if math.isinf(source.exponent) else source.exponent,
        emission_exponent=source.emission_exponent,
        two_sided=source.two_sided,
    )


def _transform_document(source: Transform) -> TransformDocument:
    if np.array_equal(source.matrix[:3, :3], np.eye(3)):
        return TransformDocument(translation=source.matrix[:3, 3].tolist())
    return TransformDocument(matrix=source.matrix.ravel().tolist())


def _camera_document(source: Camera) -> CameraDocument:
    return CameraDocument(
        eye=source.eye.tolist(),
        target=source.target.tolist(),
        up=source.up.tolist(),
        vertical_fov=source.vertical_fov,
        width=source.width,
        height=source.height,
    )
