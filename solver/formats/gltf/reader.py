"""glTF 2.0, as JSON or GLB: nodes become objects where they stand, with cameras and lights."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from solver.document.fields import MAX_COORDINATE, Location
from solver.document.models import CameraDocument
from solver.errors import SceneError
from solver.formats.building import Imported, SceneBuilder
from solver.formats.gltf.container import Container
from solver.formats.gltf.lights import add_light
from solver.formats.gltf.models import Camera, Light, Node, Primitive, Scene
from solver.formats.gltf.shapes import NGONS, polygons_of, positions, triangles_of
from solver.formats.gltf.surfaces import Painted, Painter
from solver.formats.painting import paint_groups
from solver.formats.source import ReadOptions, SourceFile, UpAxis
from solver.geometry.transform import Transform
from solver.types import FloatArray, Points

_READ: Final = {
    "KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_unlit", "KHR_texture_transform",
    "KHR_mesh_quantization", "KHR_materials_pbrSpecularGlossiness", "EXT_texture_webp", NGONS,
}  # fmt: skip
"""Extensions that a file may require."""

_MATERIALS: Final = "KHR_materials_"
"""Others of materials refine what is read of them, and may be left out."""

_ROOM: Final = 16
"""Elements of an array for each vertex that a scene may have."""

_MOST_PIXELS: Final = 8192
_HEIGHT: Final = 480


@dataclass(frozen=True, eq=False)
class _Piece:
    """Faces of one material, in the frame of their mesh."""

    vertices: Points
    faces: list[list[int]]
    painted: Painted
    values: FloatArray
    """(8,) means of the looks of its faces"""


def read_gltf(source: SourceFile, options: ReadOptions) -> Imported:
    """The scene of a file. Raises SceneError, LimitExceededError."""
    container = Container(source, _ROOM * options.limits.max_vertices)
    builder = SceneBuilder(options, UpAxis.Y)
    reader = _Reader(container, builder)
    return builder.finish(reader.read() or source.name)


class _Reader:
    """Goes through the nodes of a scene."""

    def __init__(self, container: Container, builder: SceneBuilder) -> None:
        self._container = container
        self._file = container.file
        self._builder = builder
        self._painter = Painter(container, builder)
        self._pieces: dict[int, list[_Piece]] = {}
        self._cameras: list[tuple[str, Camera, FloatArray]] = []
        self._lights: list[tuple[str, Light, FloatArray, Location]] = []

    def read(self) -> str:
        """Add all to the builder; the scene's name."""
        self._check_extensions()
        scene = self._scene()
        efficacy = _extra(scene.extras, "luminous_efficacy")
        if efficacy is not None and 0.0 < efficacy <= 1e6 and self._builder.options.luminous_efficacy is None:
            self._builder.efficacy = efficacy
        if self._file.skins or self._file.animations:
            self._builder.warn("skins and animations are left out: what they move stands as it is")
        for index, node, matrix in self._walk(scene):
            self._visit(index, node, matrix)
        # Lamps are as large as suits the scene, and cameras look at it: both need to know all of it.
        for title, light, matrix, where in self._lights:
            add_light(self._builder, light, title, matrix, where)
        for name, camera, matrix in self._cameras:
            self._add_camera(name, camera, matrix)
        return scene.name

    def _check_extensions(self) -> None:
        for k, name in enumerate(self._file.extensionsRequired):
            if name in _READ:
                continue
            if not name.startswith(_MATERIALS):
                raise SceneError(
                    f"the extension {name[:80]} is needed, and not read", ("extensionsRequired", k)
                )
            self._builder.warn(f"{name[:80]} is left out")

    def _scene(self) -> Scene:
        if self._file.scenes:
            return self._container.item(self._file.scenes, self._file.scene or 0, ("scene",), "scene")
        below = {child for node in self._file.nodes for child in node.children}
        roots = [k for k in range(len(self._file.nodes)) if k not in below]
        if self._file.nodes and not roots:
            raise SceneError("each node is within another", ("nodes",))
        return Scene(nodes=roots)

    def _walk(self, scene: Scene) -> Iterator[tuple[int, Node, FloatArray]]:
        """Nodes with their matrices (4, 4) to the world, parents first. Raises SceneError."""
        seen: set[int] = set()
        stack: list[tuple[int, FloatArray, Location]] = [
            (index, np.eye(4), ("scenes", self._file.scene or 0, "nodes")) for index in reversed(scene.nodes)
        ]
        while stack:
            index, above, where = stack.pop()
            node = self._container.item(self._file.nodes, index, where, "node")
            if index in seen:
                raise SceneError(f"node {index} is in the scene twice, or within itself", where)
            seen.add(index)
            matrix = above @ _matrix_of(node)
            if not np.isfinite(matrix).all():
                raise SceneError("the transforms multiply to more than a number", ("nodes", index))
            yield index, node, matrix
            inside: Location = ("nodes", index, "children")
            stack.extend((child, matrix, inside) for child in reversed(node.children))

    def _visit(self, index: int, node: Node, matrix: FloatArray) -> None:
        where: Location = ("nodes", index)
        if node.mesh is not None:
            mesh = self._container.item(self._file.meshes, node.mesh, (*where, "mesh"), "mesh")
            name = node.name or mesh.name or f"node {index}"
            for piece in self._pieces_of(node.mesh):
                shade = piece.painted.shade(piece.values, self._builder.efficacy)
                self._builder.add(name, piece.vertices, piece.faces, shade, where, matrix)
        if node.camera is not None:
            camera = self._container.item(self._file.cameras, node.camera, (*where, "camera"), "camera")
            self._cameras.append((node.name or camera.name, camera, matrix))
        carried = node.extensions.KHR_lights_punctual
        if carried is not None:
            lights = self._file.extensions.KHR_lights_punctual.lights
            light = self._container.item(lights, carried.light, (*where, "extensions"), "light")
            self._lights.append((node.name, light, matrix, where))

    def _pieces_of(self, index: int) -> list[_Piece]:
        if index not in self._pieces:
            mesh = self._file.meshes[index]
            self._pieces[index] = [
                piece for k in range(len(mesh.primitives)) for piece in self._pieces_of_primitive(index, k)
            ]
        return self._pieces[index]

    def _pieces_of_primitive(self, mesh: int, number: int) -> Iterator[_Piece]:
        where: Location = ("meshes", mesh, "primitives", number)
        primitive = self._file.meshes[mesh].primitives[number]
        vertices = positions(self._container, primitive, where)
        if vertices is None:
            self._builder.warn("points and lines are left out")
            return
        if primitive.targets:
            self._builder.warn("morph targets are left out")
        triangles = triangles_of(self._container, primitive, len(vertices), where)
        if len(triangles) == 0 or self._is_back(primitive):
            return
        if not np.isfinite(vertices).all():
            raise SceneError("a place is not finite", (*where, "attributes", "POSITION"))
        faces, start = polygons_of(primitive, triangles)
        painted = self._painter.paint(primitive, triangles, len(vertices), where)
        values = painted.values
        if len(values) > 1 and len(faces) < len(values):
            values = np.add.reduceat(values, start[:-1], axis=0) / np.diff(start)[:, None]
        for members, mean in paint_groups(vertices, faces, values):
            chosen = faces if members is None else [faces[member] for member in members]
            yield _Piece(vertices, chosen, painted, mean)

    def _is_back(self, primitive: Primitive) -> bool:
        """Whether this project has written it as the other side of a surface that is there already."""
        materials = self._file.materials
        if primitive.material is None or primitive.material >= len(materials):
            return False
        extras = materials[primitive.material].extras
        return isinstance(extras, dict) and extras.get("back") is True

    def _add_camera(self, name: str, camera: Camera, node: FloatArray) -> None:
        lens = camera.perspective
        if lens is None:
            self._builder.warn("orthographic cameras are left out")
            return
        scale = self._builder.options.scale
        if np.abs(node[:3, 3]).max() * scale > 0.5 * MAX_COORDINATE:
            self._builder.warn(f"the camera {name[:80]!r} is left out: it is too far away")
            return
        eye, ahead, up = node[:3, 3] * scale, -node[:3, 2], node[:3, 1]
        lengths = np.linalg.norm(ahead), np.linalg.norm(up)
        if min(lengths) < 1e-12:
            self._builder.warn(f"the camera {name[:80]!r} is left out: its node is flat")
            return
        ahead, up = ahead / lengths[0], up / lengths[1]
        distance = _extra(camera.extras, "target_distance")
        if distance is None or not 1e-6 <= distance <= 1e8:
            depth = float((self._builder.middle - eye) @ ahead)
            distance = depth if depth > 1e-3 * self._builder.size else 0.5 * self._builder.size
        height = round(_extra(camera.extras, "height") or _HEIGHT)
        height = height if 1 <= height <= _MOST_PIXELS else _HEIGHT
        width = round(height * (lens.aspectRatio or 4.0 / 3.0))
        self._builder.add_camera(
            name,
            CameraDocument(
                eye=eye.tolist(),
                target=(eye + distance * ahead).tolist(),
                up=up.tolist(),
                vertical_fov=max(1e-3, math.degrees(lens.yfov)),
                width=min(max(width, 1), _MOST_PIXELS),
                height=height,
            ),
        )


def _matrix_of(node: Node) -> FloatArray:
    """(4, 4) of a node within its parent."""
    if node.matrix is not None:
        return np.array(node.matrix).reshape(4, 4).T
    rotation = np.array(node.rotation)
    if not 1e-30 < float(np.linalg.norm(rotation)) < 1e30:
        rotation = np.array([0.0, 0.0, 0.0, 1.0])
    return Transform.from_parts(np.array(node.translation), rotation, np.array(node.scale)).matrix


def _extra(extras: Any, name: str) -> float | None:
    """A number that this project has written beside what the format knows."""
    value = extras.get(name) if isinstance(extras, dict) else None
    if not isinstance(value, int | float) or isinstance(value, bool) or abs(value) > 1e30:
        return None
    return float(value) if math.isfinite(value) else None
