"""Shapes as a binary glTF 2.0 file: metres, the scene's own axes, colours of vertices, no light needed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pygltflib as gltf

from solver.engine.overlays.shapes import Primitives, Shapes
from solver.types import AnyArray

_UNLIT: Final = "KHR_materials_unlit"
_BYTE: Final = 255.0


def glb_of(shapes: Shapes, name: str, extras: Mapping[str, object]) -> bytes:
    """The file: one node `name` whose mesh has a primitive for each kind of shape that there is.

    `extras` go to the scene's. Without shapes the file has no node.
    """
    builder = _Builder()
    for mode, figures in (
        (gltf.POINTS, shapes.points),
        (gltf.LINES, shapes.lines),
        (gltf.TRIANGLES, shapes.triangles),
    ):
        if len(figures):
            builder.add(mode, figures)
    return builder.file(name, extras)


class _Builder:
    """A file in the making."""

    def __init__(self) -> None:
        self._blob = bytearray()
        self._views: list[Any] = []
        self._accessors: list[Any] = []
        self._primitives: list[Any] = []

    def add(self, mode: int, figures: Primitives) -> None:
        """Add a primitive."""
        k = figures.position.shape[1]
        position = np.ascontiguousarray(figures.position.reshape(-1, 3), dtype="<f4")
        colour = np.full((len(position), 4), _BYTE, dtype=np.uint8)
        colour[:, :3] = np.repeat(np.rint(_BYTE * figures.colour.clip(0.0, 1.0)), k, axis=0)
        at = self._append(
            position,
            gltf.FLOAT,
            "VEC3",
            min=position.min(axis=0).tolist(),
            max=position.max(axis=0).tolist(),
        )
        coloured = self._append(colour, gltf.UNSIGNED_BYTE, "VEC4", normalized=True)
        self._primitives.append(
            gltf.Primitive(attributes=gltf.Attributes(POSITION=at, COLOR_0=coloured), mode=mode, material=0)
        )

    def _append(self, values: AnyArray, component: int, kind: str, **more: Any) -> int:
        self._views.append(
            gltf.BufferView(
                buffer=0, byteOffset=len(self._blob), byteLength=values.nbytes, target=gltf.ARRAY_BUFFER
            )
        )
        self._blob += values.tobytes()
        self._accessors.append(
            gltf.Accessor(
                bufferView=len(self._views) - 1, componentType=component, count=len(values), type=kind, **more
            )
        )
        return len(self._accessors) - 1

    def file(self, name: str, extras: Mapping[str, object]) -> bytes:
        """The bytes of the file."""
        made = gltf.GLTF2(
            asset=gltf.Asset(version="2.0", generator="halflight"),
            scene=0,
            scenes=[gltf.Scene(name=name, nodes=[0] if self._primitives else [], extras=dict(extras))],
        )
        if self._primitives:
            made.nodes = [gltf.Node(name=name, mesh=0)]
            made.meshes = [gltf.Mesh(name=name, primitives=self._primitives)]
            made.materials = [gltf.Material(doubleSided=True, alphaCutoff=None, extensions={_UNLIT: {}})]
            made.extensionsUsed = [_UNLIT]
            made.accessors = self._accessors
            made.bufferViews = self._views
            made.buffers = [gltf.Buffer(byteLength=len(self._blob))]
            made.set_binary_blob(bytes(self._blob))
        return b"".join(made.save_to_bytes())
