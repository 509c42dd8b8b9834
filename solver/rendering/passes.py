"""The OpenGL passes, one class each: all draw a whole mesh, or a whole screen, into the current target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import moderngl
import numpy as np

from solver.rendering.gpu_mesh import GpuMesh
from solver.rendering.projection import NEAR, Projection
from solver.rendering.shader_files import load_shader
from solver.rendering.targets import Target
from solver.types import Float32Array, Vector

_FACINGS: Final = 0
_LEAVES: Final = 1
_VALUES: Final = 2

_PIECE: Final = 1 << 15
"""Triangles drawn at once: software OpenGL rasterises a piece on other cores while the next is set up."""

BACK: Final = np.uint32(1 << 31)
"""Marks a black back in a target of identities."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Where a pass looks from."""

    eye: Vector
    """(3,) metres"""
    projection: Projection
    jitter: tuple[float, float] = (0.0, 0.0)
    """How far right and down of a pixel's centre the sample lies, in clip space"""


class _MeshPass:
    """A program over the vertices of a mesh, seen from a viewpoint."""

    def __init__(self, context: moderngl.Context, vertex: str, fragment: str) -> None:
        self._context = context
        self._program = context.program(
            vertex_shader=load_shader("projection", vertex), fragment_shader=load_shader(fragment)
        )
        self._set("near", NEAR)

    def _set(self, name: str, value: float | tuple[float, ...]) -> None:
        uniform = self._program[name]
        assert isinstance(uniform, moderngl.Uniform)
        uniform.value = value

    def _look(self, scene: GpuMesh, viewpoint: Viewpoint) -> None:
        seen = viewpoint.projection
        eye = seen.eye.astype(np.float32)
        self._set("eye", tuple(eye.tolist()))
        self._set("eye_rest", tuple((seen.eye - eye).tolist()))
        self._set("right", tuple(seen.right.tolist()))
        self._set("down", tuple(seen.down.tolist()))
        self._set("forward", tuple(seen.forward.tolist()))
        self._set("jitter", viewpoint.jitter)
        scene.facings(viewpoint.eye).bind_to_storage_buffer(_FACINGS)

    def _clear(self, target: Target) -> None:
        target.framebuffer.use()
        # Depth is near / distance: what is nearer has more of it.
        target.framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=0.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = ">"

    def _render(self, scene: GpuMesh, vertices: moderngl.VertexArray) -> None:
        """Draw all triangles, piece by piece."""
        count = len(scene.mesh.triangles)
        for first in range(0, count, _PIECE):
            if first > 0:
                scene.begin()
            if "first_triangle" in self._program:
                self._set("first_triangle", first)
            vertices.render(first=3 * first, vertices=3 * min(_PIECE, count - first))

    def release(self) -> None:
        """Give the program back; the context must be current."""
        self._program.release()


class GouraudPass(_MeshPass):
    """Values of vertices (v, 3), linear over triangles."""

    def __init__(self, context: moderngl.Context) -> None:
        super().__init__(context, "gouraud.vert", "gouraud.frag")

    def draw(
        self, scene: GpuMesh, viewpoint: Viewpoint, target: Target, name: str, values: Float32Array
    ) -> None:
        """Draw `values`, which the mesh's buffers keep under `name`."""
        self._look(scene, viewpoint)
        vertices = scene.vertex_array(self._program, (scene.buffer(name, values), "3f", "value"))
        self._clear(target)
        self._render(scene, vertices)


class FlatPass(_MeshPass):
    """Means of leaves, constant over them."""

    def __init__(self, context: moderngl.Context) -> None:
        super().__init__(context, "triangle.vert", "flat.frag")

    def draw(self, scene: GpuMesh, viewpoint: Viewpoint, target: Target, is_radiance: bool) -> None:
        """Draw radiance or irradiance."""
        self._look(scene, viewpoint)
        scene.buffer("leaf", scene.mesh.leaf).bind_to_storage_buffer(_LEAVES)
        scene.leaf_values(is_radiance).bind_to_storage_buffer(_VALUES)
        vertices = scene.vertex_array(self._program)
        self._clear(target)
        self._render(scene, vertices)


class IdentityPass(_MeshPass):
    """One more than the number of the triangle that a pixel shows, and `BACK` for a back; 0 for nothing."""

    def __init__(self, context: moderngl.Context) -> None:
        super().__init__(context, "triangle.vert", "identity.frag")

    def draw(self, scene: GpuMesh, viewpoint: Viewpoint, target: Target) -> None:
        """Draw into a target of identities."""
        self._look(scene, viewpoint)
        vertices = scene.vertex_array(self._program)
        self._clear(target)
        self._render(scene, vertices)


class AccumulationPass:
    """Adds frames to a mean."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = context.program(
            vertex_shader=load_shader("screen.vert"), fragment_shader=load_shader("accumulation.frag")
        )
        self._screen = context.vertex_array(self._program, [])

    def add(self, frame: Target, share: float, total: Target) -> None:
        """Add `share` times `frame` to `total`."""
        uniform = self._program["share"]
        assert isinstance(uniform, moderngl.Uniform)
        uniform.value = share
        frame.texture.use(0)
        total.framebuffer.use()
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        self._screen.render(vertices=3)

    def release(self) -> None:
        """Give the program back; the context must be current."""
        self._screen.release()
        self._program.release()
