"""A mesh in buffers of an OpenGL context.

Buffers are filled when a pass first asks for them and live until `release`. Each remembers the arrays that
it was filled from: when another mesh is held, a buffer is filled anew only if its arrays are others. Meshes
that share positions and triangles, and differ in what light falls on them, cost what differs.
Arrays are taken as the same if they are the same object: nobody writes into an array of a mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import moderngl
import numpy as np

from solver.errors import LimitExceededError
from solver.rendering.device import GlDevice
from solver.rendering.entry_points import Texel
from solver.rendering.meshes import DrawnMesh, leaf_radiance, local_positions
from solver.rendering.projection import facings
from solver.rendering.tessellation import RenderMesh
from solver.types import AnyArray, Vector

_SMALLEST: Final = 16
"""Bytes of an empty array's buffer: OpenGL has no buffers of 0."""

_TEXEL_BYTES: Final = 16


@dataclass(eq=False)
class _Kept:
    """A buffer, and how shaders are given it as texels."""

    buffer: moderngl.Buffer
    sources: tuple[object, ...]
    """What it was filled from"""
    texels: int | None = None


class GpuMesh:
    """Buffers of the mesh that is held, and the vertex arrays that passes have made of them."""

    def __init__(self, device: GlDevice, mesh: DrawnMesh) -> None:
        self.mesh = mesh
        self.uploaded = 0
        """Bytes written to the device so far"""
        self._context = device.context
        self._calls = device.entry_points
        self._kept: dict[str, _Kept] = {}
        self._vertex_arrays: dict[tuple[object, ...], moderngl.VertexArray] = {}
        self._eye: Vector | None = None

    def hold(self, mesh: DrawnMesh) -> None:
        """Be the buffers of `mesh` from now on."""
        if mesh.surfaces is not self.mesh.surfaces:
            self.release()
        self.mesh = mesh

    def buffer(self, name: str, array: AnyArray) -> moderngl.Buffer:
        """The buffer of that name, with `array` in it."""
        return self._derived(name, (array,), lambda: array).buffer

    def use_texels(
        self,
        unit: int,
        texel: Texel,
        name: str,
        sources: tuple[object, ...],
        make: Callable[[], AnyArray],
    ) -> None:
        """Let shaders find what `make` makes of `sources` as texels at `unit`; it is kept under `name`.

        Raises LimitExceededError for more texels than the device takes.
        """
        kept = self._derived(name, sources, make)
        if kept.texels is None:
            if kept.buffer.size > _TEXEL_BYTES * self._calls.most_texels:
                raise LimitExceededError(
                    f"texels of {name}", kept.buffer.size // _TEXEL_BYTES, self._calls.most_texels
                )
            kept.texels = self._calls.make_texels(kept.buffer, texel, unit)
        else:
            self._calls.use_texels(kept.texels, unit)

    def vertex_array(
        self, program: moderngl.Program, *extra: tuple[moderngl.Buffer, str, str]
    ) -> moderngl.VertexArray:
        """The mesh's vertices for `program`, with positions, patches, and `extra` buffers as attributes."""
        attributes = [(self.positions(), "3f", "position"), (self.patches(), "i", "patch_index"), *extra]
        index = self.triangles()
        key = (program, *(buffer for buffer, _, _ in attributes))
        if key not in self._vertex_arrays:
            self._vertex_arrays[key] = self._context.vertex_array(program, attributes, index_buffer=index)
        return self._vertex_arrays[key]

    def begin(self) -> None:
        """Have what has been drawn so far begun, without waiting for it."""
        self._calls.begin()

    def positions(self) -> moderngl.Buffer:
        """Local coordinates, three float32 a vertex."""
        mesh = self.mesh
        sources = (mesh.position, mesh.surfaces)
        return self._derived("position", sources, lambda: local_positions(mesh).astype(np.float32)).buffer

    def patches(self) -> moderngl.Buffer:
        """Patches of vertices, int32."""
        return self.buffer("patch", self.mesh.patch)

    def triangles(self) -> moderngl.Buffer:
        """Vertices of triangles, three int32 each."""
        return self.buffer("triangles", self.mesh.triangles)

    def leaf_values(self, is_radiance: bool) -> moderngl.Buffer:
        """Radiance or irradiance of leaves, three float32 each."""
        mesh = self.mesh
        name = f"leaf {'radiance' if is_radiance else 'irradiance'}"
        if isinstance(mesh, RenderMesh):
            return self.buffer(name, mesh.leaf_radiance if is_radiance else mesh.leaf_irradiance)
        sources = (mesh.leaf_irradiance, mesh.leaf, mesh.triangles, mesh.patch, mesh.surfaces)
        return self._derived(
            name,
            sources,
            lambda: (leaf_radiance(mesh) if is_radiance else mesh.leaf_irradiance).astype(np.float32),
        ).buffer

    def facings(self, eye: Vector) -> moderngl.Buffer:
        """Facings of patches seen from `eye` (3,) in metres, int32."""
        surfaces = self.mesh.surfaces
        if self._eye is None or not np.array_equal(self._eye, eye):
            self._eye = eye.copy()
        # The copy stands for the eye: it is another object only where the eye is another.
        return self._derived("facings", (surfaces, self._eye), lambda: facings(surfaces, eye)).buffer

    def release(self) -> None:
        """Give all back; the context must be current."""
        self._release_vertex_arrays()
        for kept in self._kept.values():
            self._release(kept)
        self._kept.clear()

    def _derived(self, name: str, sources: tuple[object, ...], make: Callable[[], AnyArray]) -> _Kept:
        """The buffer of that name, with what `make` makes of `sources` in it."""
        kept = self._kept.get(name)
        if kept is not None and _are_same(kept.sources, sources):
            return kept
        data = np.ascontiguousarray(make())
        self.uploaded += data.nbytes
        if kept is not None and kept.buffer.size == data.nbytes:
            kept.buffer.write(data)
            kept.sources = sources
            return kept
        if kept is not None:
            self._release_vertex_arrays()
            self._release(self._kept.pop(name))
        made = self._context.buffer(data if data.size else bytes(_SMALLEST))
        self._kept[name] = _Kept(made, sources)
        return self._kept[name]

    def _release(self, kept: _Kept) -> None:
        if kept.texels is not None:
            self._calls.release_texels(kept.texels)
        kept.buffer.release()

    def _release_vertex_arrays(self) -> None:
        for vertex_array in self._vertex_arrays.values():
            vertex_array.release()
        self._vertex_arrays.clear()


def _are_same(some: tuple[object, ...], others: tuple[object, ...]) -> bool:
    """Whether these are the same objects."""
    return len(some) == len(others) and all(a is b for a, b in zip(some, others, strict=True))
