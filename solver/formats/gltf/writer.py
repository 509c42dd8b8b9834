"""A scene as binary glTF: objects as they stand, with materials, cameras and lamps.

Quadrilaterals and other convex faces are marked as what they are (FB_ngon_encoding), so that they come
back as such; concave ones are triangles. What glTF has no words for stands in `extras` of materials,
under the names of a scene document, and beside it what any other reader understands: base colour,
metallic and roughness, and the emitted luminance in cd/m2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pygltflib as gltf

from solver.formats.gltf.buffers import Buffers
from solver.formats.gltf.shapes import NGONS
from solver.geometry.faces import split_faces
from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.geometry.transform import Transform
from solver.types import FloatArray, IntArray, Points

STRENGTH: Final = "KHR_materials_emissive_strength"

_SHEAR: Final = 1e-9
"""Cosine between the axes of a node, at most: glTF has translations, rotations and scales alone."""


def scene_glb(scene: Scene, extras: Mapping[str, object]) -> bytes:
    """The file; `extras` go to the scene's, with the luminous efficacy."""
    writer = SceneWriter(scene.name, {**extras, "luminous_efficacy": scene.luminous_efficacy})
    for placed in scene:
        each = _in_the_world(placed) if _is_sheared(placed.transform) else placed
        corners, indices, is_polygonal = _faces(each)
        if len(indices):
            material = writer.material(each.id, each.material, scene.luminous_efficacy)
            writer.add(each.id, corners, indices, material, each.transform, is_polygonal)
    for name, camera in scene.cameras.items():
        writer.camera(name, camera)
    return writer.file()


class SceneWriter:
    """A file in the making."""

    def __init__(self, name: str, extras: Mapping[str, object]) -> None:
        self._buffers = Buffers()
        self._used: set[str] = set()
        self._nodes: list[Any] = []
        self._meshes: list[Any] = []
        self._materials: list[Any] = []
        self._cameras: list[Any] = []
        self._scene = gltf.Scene(name=name or "scene", extras=dict(extras))

    def material(self, name: str, source: Material, efficacy: float) -> int:
        """A material that stays what it is; lm/W."""
        glow = source.emission * efficacy / math.pi
        strength = float(glow.max())
        extensions: dict[str, Any] = {}
        if strength > 0.0:
            # Factors are at most 1: what is more goes into the strength.
            extensions[STRENGTH] = {"emissiveStrength": strength}
            self._used.add(STRENGTH)
        base, metallic, roughness = _metallic(source)
        self._materials.append(
            gltf.Material(
                name=name,
                alphaCutoff=None,
                doubleSided=source.two_sided,
                emissiveFactor=(glow / strength).tolist() if strength > 0.0 else [0.0, 0.0, 0.0],
                extensions=extensions,
                pbrMetallicRoughness=gltf.PbrMetallicRoughness(
                    baseColorFactor=[*base.tolist(), 1.0], metallicFactor=metallic, roughnessFactor=roughness
                ),
                extras=material_extras(source),
            )
        )
        return len(self._materials) - 1

    def unlit(self, name: str, source: Material, extension: str, is_back: bool = False) -> int:
        """A material that is shown as the colours of vertices are, on one side.

        What it is made of goes into `extras`; those of a back say that it is one, and it comes back with the
        front.
        """
        self._used.add(extension)
        self._materials.append(
            gltf.Material(
                name=name,
                alphaCutoff=None,
                extensions={extension: {}},
                pbrMetallicRoughness=gltf.PbrMetallicRoughness(metallicFactor=0.0, roughnessFactor=1.0),
                extras={"back": True} if is_back else material_extras(source),
            )
        )
        return len(self._materials) - 1

    def add(
        self,
        name: str,
        corners: Points,
        indices: IntArray,
        material: int,
        transform: Transform | None,
        is_polygonal: bool,
        colours: FloatArray | None = None,
    ) -> None:
        """A node with the triangles `indices` (3 t,) over `corners` (n, 3), with linear `colours` (n, 3)."""
        made = gltf.Primitive(
            attributes=gltf.Attributes(POSITION=self._buffers.positions(corners)),
            indices=self._buffers.array(
                indices.astype("<u4"), gltf.UNSIGNED_INT, "SCALAR", gltf.ELEMENT_ARRAY_BUFFER
            ),
            material=material,
            mode=gltf.TRIANGLES,
        )
        if colours is not None:
            values = np.ascontiguousarray(colours.clip(0.0, 1.0), dtype="<f4")
            made.attributes.COLOR_0 = self._buffers.array(values, gltf.FLOAT, "VEC3")
        if is_polygonal:
            made.extensions = {NGONS: {}}
            self._used.add(NGONS)
        node = gltf.Node(name=name, mesh=len(self._meshes))
        if transform is not None and not np.array_equal(transform.matrix, np.eye(4)):
            node.matrix = transform.matrix.T.ravel().tolist()
        self._nodes.append(node)
        self._meshes.append(gltf.Mesh(name=name, primitives=[made]))

    def camera(self, name: str, camera: Camera) -> None:
        """A camera with a node of its own."""
        right, above, forward = camera.basis()
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([right, above, -forward], axis=1)
        matrix[:3, 3] = camera.eye
        distance = float(np.linalg.norm(camera.target - camera.eye))
        lens = gltf.Perspective(
            yfov=math.radians(camera.vertical_fov), aspectRatio=camera.width / camera.height, znear=0.01
        )
        extras = {"target_distance": distance, "width": camera.width, "height": camera.height}
        self._nodes.append(gltf.Node(name=name, camera=len(self._cameras), matrix=matrix.T.ravel().tolist()))
        self._cameras.append(gltf.Camera(name=name, type="perspective", perspective=lens, extras=extras))

    def file(self) -> bytes:
        """The bytes of the file."""
        self._scene.nodes = list(range(len(self._nodes)))
        made = gltf.GLTF2(
            asset=gltf.Asset(version="2.0", generator="halflight"), scene=0, scenes=[self._scene]
        )
        made.nodes, made.meshes, made.materials = self._nodes, self._meshes, self._materials
        made.cameras = self._cameras
        made.extensionsUsed = sorted(self._used)
        if self._meshes:
            self._buffers.put_into(made)
        return b"".join(made.save_to_bytes())


def material_extras(source: Material) -> dict[str, object]:
    """The fields of a scene document's material."""
    return {
        "reflectance": source.reflectance.tolist(),
        "emission": source.emission.tolist(),
        "specular": source.specular.tolist(),
        "exponent": None if math.isinf(source.exponent) else source.exponent,
        "emission_exponent": source.emission_exponent,
        "two_sided": source.two_sided,
    }


def _metallic(source: Material) -> tuple[FloatArray, float, float]:
    """Base colour (3,), metallic and roughness that look most like it."""
    total = source.reflectance + source.specular
    metallic = float(source.specular.sum() / total.sum()) if total.any() else 0.0
    if metallic == 0.0:
        return source.reflectance, 0.0, 1.0
    slope = 0.0 if math.isinf(source.exponent) else math.sqrt(2.0 / (4.0 * source.exponent + 2.0))
    return total, metallic, math.sqrt(slope)


def _faces(source: SceneObject) -> tuple[Points, IntArray, bool]:
    """Corners (n, 3) of an object's patches in its own frame, their triangles (3 t,), and whether marked.

    Each patch has corners of its own, so that no two polygons in a row begin with the same.
    """
    split = split_faces(source.mesh.vertices, source.mesh.faces, 0.0)
    there = np.arange(4) < split.corner_count[:, None]
    first = np.cumsum(split.corner_count) - split.corner_count
    fans = first[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    indices = fans[np.arange(2) < (split.corner_count - 2)[:, None]].ravel()
    return split.corners[there], indices.astype(np.int32), bool((split.corner_count == 4).any())


def _in_the_world(source: SceneObject) -> SceneObject:
    """The same surface without a transform."""
    faces = source.mesh.faces
    if source.transform.mirrors:
        faces = tuple(face[::-1] for face in faces)
    return SceneObject(source.id, Mesh(source.world_vertices, faces), source.material)


def _is_sheared(transform: Transform) -> bool:
    """Whether a transform is more than a translation, a rotation and scales."""
    axes = transform.matrix[:3, :3] / np.linalg.norm(transform.matrix[:3, :3], axis=0)
    return bool(np.abs(axes.T @ axes - np.eye(3)).max() > _SHEAR)
