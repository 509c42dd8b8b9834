"""The binary part of a glTF file: arrays and pictures one after the other, with what says where they are."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pygltflib as gltf

from solver.types import AnyArray

UNLIT: Final = "KHR_materials_unlit"
"""The extension by which colours are shown as they are."""

_ALIGNMENT: Final = 4


class Buffers:
    """A binary part in the making."""

    def __init__(self) -> None:
        self._blob = bytearray()
        self._views: list[Any] = []
        self._accessors: list[Any] = []

    def positions(self, points: AnyArray) -> int:
        """Add points (n, 3) as float32, with their bounds; the number of the accessor."""
        position = np.ascontiguousarray(points, dtype="<f4")
        low, high = position.min(axis=0).tolist(), position.max(axis=0).tolist()
        return self.array(position, gltf.FLOAT, "VEC3", min=low, max=high)

    def array(
        self, values: AnyArray, component: int, kind: str, target: int = gltf.ARRAY_BUFFER, **more: Any
    ) -> int:
        """Add an array of `component`s, `kind` after `kind`; the number of the accessor."""
        view = self.view(values.tobytes(), target)
        self._accessors.append(
            gltf.Accessor(bufferView=view, componentType=component, count=len(values), type=kind, **more)
        )
        return len(self._accessors) - 1

    def view(self, content: bytes, target: int | None = None) -> int:
        """Add bytes; the number of their view."""
        self._blob += bytes(-len(self._blob) % _ALIGNMENT)
        self._views.append(
            gltf.BufferView(buffer=0, byteOffset=len(self._blob), byteLength=len(content), target=target)
        )
        self._blob += content
        return len(self._views) - 1

    def put_into(self, file: gltf.GLTF2) -> None:
        """Let `file` have all of it."""
        self._blob += bytes(-len(self._blob) % _ALIGNMENT)
        file.accessors = self._accessors
        file.bufferViews = self._views
        file.buffers = [gltf.Buffer(byteLength=len(self._blob))]
        file.set_binary_blob(bytes(self._blob))
