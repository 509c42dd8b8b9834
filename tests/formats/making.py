"""Small files of each format, and what their scenes measure."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from solver.document.conversion import scene_of
from solver.formats.building import Imported
from solver.formats.reading import SceneFormat, read_scene
from solver.formats.source import ReadOptions, SourceFile
from solver.geometry.scene import Scene
from solver.geometry.surfaces import flatten
from solver.types import LUMINANCE_WEIGHTS, AnyArray

EFFICACY = 179.0


def read(content: bytes | str, chosen: str, **options: Any) -> Imported:
    """What is read of a file."""
    raw = content.encode() if isinstance(content, str) else content
    return read_scene(SourceFile(f"file.{chosen}", raw), SceneFormat(chosen), ReadOptions(**options))


def scene(imported: Imported) -> Scene:
    return scene_of(imported.document)


def areas(imported: Imported) -> dict[str, float]:
    """m2 of the fronts of each object."""
    surfaces = flatten(scene(imported))
    front = surfaces.side == 0
    total = np.bincount(surfaces.object[front], surfaces.area[front], len(surfaces.object_ids))
    return dict(zip(surfaces.object_ids, total.tolist(), strict=True))


def lumens(imported: Imported, name: str) -> float:
    """Of one object, both sides."""
    made = scene(imported)
    surfaces = flatten(made)
    mine = surfaces.object == surfaces.object_ids.index(name)
    watts = float((surfaces.area[mine] * (surfaces.emission[mine] @ LUMINANCE_WEIGHTS)).sum())
    return watts * made.luminous_efficacy


def gltf_json(**members: Any) -> dict[str, Any]:
    return {"asset": {"version": "2.0"}, **members}


class GlbFile:
    """A GLB in the making: arrays go to its binary chunk."""

    def __init__(self) -> None:
        self.file = gltf_json(accessors=[], bufferViews=[], nodes=[], meshes=[], materials=[])
        self._blob = b""

    def view(self, content: bytes) -> int:
        self._blob += bytes(-len(self._blob) % 4)
        views = self.file["bufferViews"]
        views.append({"buffer": 0, "byteOffset": len(self._blob), "byteLength": len(content)})
        self._blob += content
        return len(views) - 1

    def array(self, values: AnyArray, component: int, kind: str, **more: Any) -> int:
        entry = {"bufferView": self.view(values.tobytes()), "componentType": component, "count": len(values)}
        self.file["accessors"].append({**entry, "type": kind, **more})
        return len(self.file["accessors"]) - 1

    def points(self, points: Any) -> int:
        return self.array(np.array(points, dtype="<f4").reshape(-1, 3), 5126, "VEC3")

    def indices(self, indices: Any) -> int:
        return self.array(np.array(indices, dtype="<u2").ravel(), 5123, "SCALAR")

    def add(self, points: Any, indices: Any, material: Any = None, **node: Any) -> None:
        """A node with a mesh of triangles."""
        primitive: dict[str, Any] = {
            "attributes": {"POSITION": self.points(points)},
            "indices": self.indices(indices),
        }
        if material is not None:
            primitive["material"] = len(self.file["materials"])
            self.file["materials"].append(material)
        self.file["nodes"].append({"mesh": len(self.file["meshes"]), **node})
        self.file["meshes"].append({"primitives": [primitive]})

    def bytes(self) -> bytes:
        self.file["buffers"] = [{"byteLength": len(self._blob)}]
        text = json.dumps(self.file).encode()
        text += b" " * (-len(text) % 4)
        blob = self._blob + bytes(-len(self._blob) % 4)
        length = 12 + 8 + len(text) + 8 + len(blob)
        return (
            struct.pack("<4sII", b"glTF", 2, length)
            + struct.pack("<II", len(text), 0x4E4F534A)
            + text
            + struct.pack("<II", len(blob), 0x004E4942)
            + blob
        )


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
TWO_TRIANGLES = [0, 1, 2, 0, 2, 3]


def square_glb(material: Any = None, **node: Any) -> GlbFile:
    """A unit square of two triangles in the plane z = 0, which faces along z."""
    file = GlbFile()
    file.add(SQUARE, TWO_TRIANGLES, material, **node)
    return file


IES = """IESNA:LM-63-2002
[TEST] 1
[LUMCAT] DOWNLIGHT
TILT=NONE
1 -1 1 {verticals} {horizontals} 1 2 0.5 0.25 0
1 1 20
{vertical}
{horizontal}
{candela}
"""


def ies(vertical: Any, candela: Any, horizontal: Any = (0,)) -> str:
    """A file of candelas (m, n)."""
    rows = np.atleast_2d(candela)
    return IES.format(
        verticals=len(vertical),
        horizontals=len(horizontal),
        vertical=" ".join(f"{angle:g}" for angle in vertical),
        horizontal=" ".join(f"{angle:g}" for angle in horizontal),
        candela="\n".join(" ".join(f"{value:.9g}" for value in row) for row in rows),
    )


def binary_stl(triangles: Any) -> bytes:
    corners = np.array(triangles, dtype="<f4").reshape(-1, 3, 3)
    facets = b"".join(bytes(12) + corner.tobytes() + bytes(2) for corner in corners)
    return bytes(80) + struct.pack("<I", len(corners)) + facets
