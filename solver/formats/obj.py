"""OBJ: polygons as they are, grouped by object and material; MTL and its textures where they come along.

OBJ says nothing of sides: surfaces are two-sided unless asked otherwise, but for what emits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from solver.errors import LimitExceededError, SceneError
from solver.formats.building import Imported, SceneBuilder
from solver.formats.mtl import MtlMaterial, read_mtl
from solver.formats.painting import paint_groups
from solver.formats.source import ReadOptions, SourceFile, UpAxis
from solver.formats.text import integer_of, numbered_lines, numbers_of
from solver.formats.textures import Texture, UnreadableTextureError
from solver.types import FloatArray, Points

_ROOM: Final = 16
"""Vertices of a file for each that a scene may have."""

_IGNORED: Final = {"vn", "s", "mg", "l", "p", "vp"}
"""Normals, smoothing, lines and points."""


@dataclass
class _Group:
    """Faces of one object and material."""

    name: str
    material: str | None
    faces: list[list[int]] = field(default_factory=list)
    texture: list[list[int]] = field(default_factory=list)
    """Of each face its indices into the texture coordinates; empty where it has none"""


class _Reader:
    """What has been read of a file so far."""

    def __init__(self, source: SourceFile, options: ReadOptions) -> None:
        self._source = source
        self._most = _ROOM * options.limits.max_vertices
        self.builder = SceneBuilder(options, UpAxis.Y)
        self.vertices: list[list[float]] = []
        self.coordinates: list[list[float]] = []
        self.groups: dict[tuple[str, str | None], _Group] = {}
        self.materials: dict[str, MtlMaterial] = {}
        self._corners = 0

    def read(self) -> None:
        """Read all lines. Raises SceneError, LimitExceededError."""
        name, material = "", None
        for line, words in numbered_lines(self._source.content):
            key, rest = words[0], words[1:]
            match key:
                case "v":
                    self.vertices.append(numbers_of(rest, line, 3))
                case "vt":
                    self.coordinates.append(numbers_of([*rest, "0"], line, 2))
                case "f":
                    self._face(name, material, rest, line)
                case "o" | "g":
                    name = " ".join(rest) or name
                case "usemtl":
                    material = " ".join(rest)
                case "mtllib":
                    self._library(" ".join(rest))
                case _ if key in _IGNORED:
                    pass
                case _:
                    # Free-form curves, display attributes and what else there is hold no polygon.
                    if not key.isidentifier():
                        raise SceneError(f"{key[:40]!r} is no word of OBJ", ("line", line))
                    self.builder.warn(f"{key[:40]!r} of OBJ is left out")
            if len(self.vertices) + self._corners > self._most:
                raise LimitExceededError("vertices", len(self.vertices) + self._corners, self._most)

    def _face(self, name: str, material: str | None, words: list[str], line: int) -> None:
        if len(words) < 3:
            raise SceneError(f"a face of {len(words)} corners", ("line", line))
        group = self.groups.setdefault((name, material), _Group(name, material))
        corners, coordinates = [], []
        for word in words:
            parts = word.split("/")
            corners.append(_index(parts[0], len(self.vertices), "vertex", line))
            if len(parts) > 1 and parts[1]:
                coordinates.append(_index(parts[1], len(self.coordinates), "texture coordinate", line))
        self._corners += len(corners)
        group.faces.append(corners)
        group.texture.append(coordinates if len(coordinates) == len(corners) else [])

    def _library(self, name: str) -> None:
        content = self._source.neighbour(name)
        if content is None:
            self.builder.warn(f"materials are missing: {name[:80]!r} has not come with the file")
        else:
            self.materials |= read_mtl(content, name)

    def finish(self) -> Imported:
        """The scene of what has been read."""
        vertices = np.array(self.vertices, dtype=np.float64).reshape(-1, 3)
        coordinates = np.array(self.coordinates, dtype=np.float64).reshape(-1, 2)
        for number, group in enumerate(self.groups.values()):
            self._add(number, group, vertices, coordinates)
        return self.builder.finish(self._source.name)

    def _add(self, number: int, group: _Group, vertices: Points, coordinates: FloatArray) -> None:
        material = self.materials.get(group.material or "")
        if material is None:
            material = MtlMaterial()
            if group.material is not None:
                self.builder.warn(f"there is no material {group.material[:80]!r}: it is grey")
        if material.is_transparent:
            self.builder.warn("transparency is left out: its surfaces are opaque")
        if material.specular.any() and not material.reflects:
            self.builder.warn("Ks is left out where `illum` does not trace reflections (3, 5 or 8)")
        wanted = self.builder.options.two_sided
        two_sided = not material.emits if wanted is None else wanted
        name = group.name or group.material or self._source.name
        used = sorted({corner for face in group.faces for corner in face})
        place = {corner: k for k, corner in enumerate(used)}
        points = vertices[used]
        faces = [[place[corner] for corner in face] for face in group.faces]
        colours = self._colours(group, material, coordinates)
        for members, colour in paint_groups(points, faces, colours):
            chosen = faces if members is None else [faces[member] for member in members]
            shade = material.shade(colour, two_sided)
            self.builder.add(name, points, chosen, shade, ("groups", number))

    def _colours(self, group: _Group, material: MtlMaterial, coordinates: FloatArray) -> FloatArray:
        """(f, 3) reflectances of the faces, or (1, 3) of all."""
        plain = material.diffuse[None]
        if material.picture is None:
            return plain
        content = self._source.neighbour(material.picture)
        if content is None:
            self.builder.warn(f"the texture {material.picture[:80]!r} has not come with the file")
            return plain
        try:
            texture = Texture.decode(content)
        except UnreadableTextureError as refused:
            raise SceneError(str(refused), (material.picture,)) from None
        self.builder.warn("textures are averaged over faces")
        shown = [coordinates[face] * [1.0, -1.0] + [0.0, 1.0] if face else None for face in group.texture]
        # A whole picture stands for faces that say not where they are in it; it scales Kd, if that is not 0.
        factor = np.where(material.diffuse > 0.0, material.diffuse, 1.0)
        return texture.polygon_means(shown) * factor


def _index(word: str, count: int, what: str, line: int) -> int:
    """From 0; a file counts from 1, or backwards from -1."""
    given = integer_of(word, line)
    index = given - 1 if given > 0 else count + given
    if given == 0 or not 0 <= index < count:
        raise SceneError(f"there is no {what} {given}: {count} have come so far", ("line", line))
    return index


def read_obj(source: SourceFile, options: ReadOptions) -> Imported:
    """The scene of a file, with its MTL where it lies beside it. Raises SceneError, LimitExceededError."""
    reader = _Reader(source, options)
    reader.read()
    return reader.finish()
