"""A mesh in buffers of an OpenGL context.

Buffers are filled when a pass first asks for them and live until `release`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import moderngl
import numpy as np

from solver.rendering.projection import facings
from solver.rendering.tessellation import RenderMesh
from solver.types import AnyArray, Vector

_SMALLEST: Final = 16
"""Bytes of an empty array's buffer: OpenGL has no buffers of 0."""


class GpuMesh:
    """Buffers of one `RenderMesh`, and the vertex arrays that passes have made of them."""

    def __init__(self, context: moderngl.Context, mesh: RenderMesh) -> None:
        self.mesh = mesh
        self._context = context
        self._buffers: dict[str, moderngl.Buffer] = {}
        self._vertex_arrays: dict[object, moderngl.VertexArray] = {}
        self._eye: Vector | None = None

    def buffer(self, name: str, array: AnyArray) -> moderngl.Buffer:
        """The buffer of that name; filled with `array` when first asked for."""
        if name not in self._buffers:
            data = np.ascontiguousarray(array)
            self._buffers[name] = self._context.buffer(data if data.size else bytes(_SMALLEST))
        return self._buffers[name]

    def vertex_array(self, key: object, make: Callable[[], moderngl.VertexArray]) -> moderngl.VertexArray:
        """The vertex array under `key`; made when first asked for."""
        if key not in self._vertex_arrays:
            self._vertex_arrays[key] = make()
        return self._vertex_arrays[key]

    def positions(self) -> moderngl.Buffer:
        """Local coordinates, three float32 a vertex."""
        return self.buffer("position", self.mesh.position)

    def patches(self) -> moderngl.Buffer:
        """Patches of vertices, int32."""
        return self.buffer("patch", self.mesh.patch)

    def triangles(self) -> moderngl.Buffer:
        """Vertices of triangles, three int32 each."""
        return self.buffer("triangles", self.mesh.triangles)

    def facings(self, eye: Vector) -> moderngl.Buffer:
        """Facings of patches seen from `eye` (3,) in metres, int32."""
        found = facings(self.mesh.surfaces, eye)
        kept = self.buffer("facings", found)
        if found.size and (self._eye is None or not np.array_equal(self._eye, eye)):
            kept.write(found)
        self._eye = eye.copy()
        return kept

    def release(self) -> None:
        """Give all back; the context must be current."""
        for vertex_array in self._vertex_arrays.values():
            vertex_array.release()
        for buffer in self._buffers.values():
            buffer.release()
        self._vertex_arrays.clear()
        self._buffers.clear()
