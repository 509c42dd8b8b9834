"""Reading MGF: entities one after the other, within transforms, arrays and named objects.

Lengths are metres, `ed` lumens per square metre, which the luminous efficacy makes watts. Amounts are of
luminance, so that `rd 0.5` of any colour reflects half of the luminance of white. Surfaces have two sides
unless `sides 1` says otherwise. Other files are not read: `i` is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from solver.errors import LimitExceededError, SceneError
from solver.formats.building import Imported, SceneBuilder
from solver.formats.lamps import area_of
from solver.formats.mgf.contexts import MgfMaterial, MgfVertex, Named, colour_of, with_amount
from solver.formats.mgf.solids import Solid, ball, cone, prism, ring
from solver.formats.mgf.transforms import placements
from solver.formats.source import ReadOptions, SourceFile, UpAxis
from solver.formats.text import number_of, numbered_lines, numbers_of
from solver.types import FloatArray, Points, Vector

_MOST_STEPS: Final = 200_000
"""Entities that are carried out, arrays and all."""

_MOST_DEPTH: Final = 64
_ROOM: Final = 16
"""Faces for each that a scene may have, before it is known what becomes of them."""

_COLOURS: Final = {"cxy", "cspec", "cct", "cmix"}
_AMOUNTS: Final = {"sides", "rd", "ed", "rs", "td", "ts", "ir"}


@dataclass
class _Loop:
    """A transform that is open, and which of its copies is at work."""

    begin: int
    """Place of the first entity within it"""
    matrices: list[FloatArray]
    """(4, 4) to the world"""
    copy: int = 0


@dataclass
class _Part:
    """Faces of one object and material."""

    name: str
    material: MgfMaterial
    more: float
    """By how much its emission makes up for lost area"""
    line: int
    vertices: list[Points] = field(default_factory=list)
    faces: list[list[int]] = field(default_factory=list)
    count: int = 0


class _Reader:
    """What has been read so far."""

    def __init__(self, source: SourceFile, options: ReadOptions) -> None:
        self._name = source.name
        self._lines = list(numbered_lines(source.content))
        self._most = _ROOM * options.limits.max_polygons
        self.builder = SceneBuilder(options, UpAxis.Z)
        self._colours: Named[Vector] = Named("colour", np.ones(3))
        self._materials: Named[MgfMaterial] = Named("material", MgfMaterial())
        self._vertices: Named[MgfVertex] = Named("vertex", MgfVertex(np.zeros(3), np.zeros(3)))
        self._loops: list[_Loop] = []
        self._objects: list[tuple[str, int]] = []
        self._serial = 0
        self._parts: dict[tuple[int, int, float], _Part] = {}
        self._held: list[MgfMaterial] = []
        """Materials by whose identity parts are told apart"""
        self._faces = 0

    def read(self) -> None:
        """Carry all entities out. Raises SceneError, LimitExceededError."""
        at = steps = 0
        while at < len(self._lines):
            line, words = self._lines[at]
            at = self._enter(at, line, words[1:]) if words[0] == "xf" else at + 1
            if words[0] != "xf":
                self._carry_out(words[0], words[1:], line)
            steps += 1
            if steps > _MOST_STEPS:
                raise LimitExceededError("entities", steps, _MOST_STEPS)
        if self._loops or self._objects:
            raise SceneError("the file ends within a transform or an object")

    def finish(self) -> Imported:
        """The scene of what has been read."""
        for part in self._parts.values():
            shade = part.material.shade(self.builder.efficacy, part.more)
            self.builder.add(part.name, np.concatenate(part.vertices), part.faces, shade, ("line", part.line))
        return self.builder.finish(self._name)

    def _enter(self, at: int, line: int, words: Sequence[str]) -> int:
        """Begin a transform, or go on after the end of one; the place of the next entity."""
        if words:
            if len(self._loops) >= _MOST_DEPTH:
                raise LimitExceededError("transforms within one another", len(self._loops) + 1, _MOST_DEPTH)
            above = self._matrix
            self._loops.append(_Loop(at + 1, [above @ m for m in placements(words, line)]))
            return at + 1
        if not self._loops:
            raise SceneError("xf ends a transform, and none has begun", ("line", line))
        loop = self._loops[-1]
        loop.copy += 1
        if loop.copy < len(loop.matrices):
            return loop.begin
        self._loops.pop()
        return at + 1

    @property
    def _matrix(self) -> FloatArray:
        """(4, 4) to the world."""
        return self._loops[-1].matrices[self._loops[-1].copy] if self._loops else np.eye(4)

    def _carry_out(self, key: str, words: Sequence[str], line: int) -> None:
        if key in _COLOURS:
            colour = colour_of(key, words, line, self._colours)
            self._colours.change(lambda _: colour)
        elif key in _AMOUNTS:
            material = with_amount(self._materials.current, key, words, line, self._colours.current)
            self._materials.change(lambda _: material)
            if material.transmits:
                self.builder.warn("transmission is left out: its surfaces are opaque")
        elif key in {"c", "m", "v"}:
            contexts: dict[str, Named[Vector] | Named[MgfMaterial] | Named[MgfVertex]]
            contexts = {"c": self._colours, "m": self._materials, "v": self._vertices}
            contexts[key].select(words, line)
        elif key == "p":
            place = np.array(numbers_of(words, line, 3))
            self._vertices.change(lambda vertex: MgfVertex(place, vertex.normal))
        elif key == "n":
            normal = np.array(numbers_of(words, line, 3))
            self._vertices.change(lambda vertex: MgfVertex(vertex.place, normal))
        elif key == "o":
            self._object(words, line)
        else:
            self._shape(key, words, line)

    def _object(self, words: Sequence[str], line: int) -> None:
        if words:
            if len(self._objects) >= _MOST_DEPTH:
                raise LimitExceededError("objects within one another", len(self._objects) + 1, _MOST_DEPTH)
            self._serial += 1
            self._objects.append((" ".join(words), self._serial))
        elif self._objects:
            self._objects.pop()
        else:
            raise SceneError("o ends an object, and none has begun", ("line", line))

    def _shape(self, key: str, words: Sequence[str], line: int) -> None:
        match key:
            case "f":
                if len(words) < 3:
                    raise SceneError(f"a face of {len(words)} corners", ("line", line))
                places = self._places(words, line)
                self._take(Solid(places, [list(range(len(places)))], 0.0), line, exact=True)
            case "sph":
                self._require(words, 2, line)
                self._take(ball(self._places(words[:1], line)[0], self._length(words[1], line)), line)
            case "cyl":
                self._require(words, 3, line)
                self._side([words[0], words[1], words[2], words[1]], line)
            case "cone":
                self._require(words, 4, line)
                self._side(words, line)
            case "ring":
                self._require(words, 3, line)
                vertex = self._vertices.find(words[0], line)
                normal = self._matrix[:3, :3] @ vertex.normal
                inner, outer = (self._length(word, line) for word in words[1:3])
                self._take(ring(self._places(words[:1], line)[0], normal, inner, outer), line)
            case "prism":
                if len(words) < 4:
                    raise SceneError("a prism has three corners or more, and a length", ("line", line))
                base = self._places(words[:-1], line)
                sign = -1.0 if self._is_mirrored else 1.0
                self._take(prism(base[:: int(sign)], self._length(words[-1], line)), line, exact=True)
            case "i":
                raise SceneError("other files are not included: send one file with all of it", ("line", line))
            case "ies" | "torus" | "fh":
                self.builder.warn(f"{key!r} of MGF is left out")
            case _:
                raise SceneError(f"{key[:40]!r} is no word of MGF", ("line", line))

    def _require(self, words: Sequence[str], count: int, line: int) -> None:
        if len(words) < count:
            raise SceneError(f"{count} words are needed, and there are {len(words)}", ("line", line))

    def _side(self, words: Sequence[str], line: int) -> None:
        first, second = self._places([words[0], words[2]], line)
        radii = self._length(words[1], line), self._length(words[3], line)
        self._take(cone(first, radii[0], second, radii[1]), line)

    def _places(self, names: Sequence[str], line: int) -> Points:
        """(n, 3) of vertices in the world."""
        local = np.stack([self._vertices.find(name, line).place for name in names])
        return np.asarray(local @ self._matrix[:3, :3].T + self._matrix[:3, 3])

    def _length(self, word: str, line: int) -> float:
        """Metres in the world: transforms scale all ways alike."""
        factor = abs(float(np.linalg.det(self._matrix[:3, :3]))) ** (1.0 / 3.0)
        return number_of(word, line) * float(factor)

    @property
    def _is_mirrored(self) -> bool:
        return bool(np.linalg.det(self._matrix[:3, :3]) < 0.0)

    def _take(self, solid: Solid | None, line: int, exact: bool = False) -> None:
        """Add a shape to the object and the material that are current."""
        if solid is None:
            self.builder.warn("shapes without area are left out")
            return
        self._faces += len(solid.faces)
        if self._faces > self._most:
            raise LimitExceededError("faces", self._faces, self._most)
        material = self._materials.current
        if material not in self._held[-1:]:
            self._held.append(material)
        more = 1.0
        if not exact:
            self.builder.warn("curved surfaces are made of polygons; what emits makes up for the area")
            area = area_of(solid.vertices, solid.faces)
            more = round(solid.area / area, 6) if material.emission[0] > 0.0 and area > 0.0 else 1.0
        number = self._objects[-1][1] if self._objects else 0
        name = "/".join(title for title, _ in self._objects) or self._name
        key = (number, id(material), more)
        part = self._parts.setdefault(key, _Part(name, material, more, line))
        # A mirror would turn a face inside out; solids are made in the world, and are not mirrored.
        turned = exact and self._is_mirrored and len(solid.faces) == 1
        for face in solid.faces:
            part.faces.append([part.count + k for k in (face[::-1] if turned else face)])
        part.vertices.append(solid.vertices)
        part.count += len(solid.vertices)


def read_mgf(source: SourceFile, options: ReadOptions) -> Imported:
    """The scene of a file. Raises SceneError, LimitExceededError."""
    reader = _Reader(source, options)
    reader.read()
    return reader.finish()
