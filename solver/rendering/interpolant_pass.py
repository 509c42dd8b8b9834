"""The pass that draws interpolants ([H 3.4]): each pixel evaluates the quadratic of its triangle.

[H] draws triangles' numbers and barycentric coordinates, reads both back and evaluates on the CPU. Here the
numbers stay on the device, where a second pass over the screen finds coordinates and evaluates once a pixel,
however many triangles lie behind one another and however small they are.
"""

from __future__ import annotations

from typing import Final

import moderngl
import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.rendering.entry_points import Texel
from solver.rendering.gpu_mesh import GpuMesh
from solver.rendering.meshes import local_positions, triangle_patches
from solver.rendering.passes import Viewpoint
from solver.rendering.shader_files import load_shader
from solver.rendering.targets import Target
from solver.rendering.triangle_frames import frame_records
from solver.types import Float32Array

_IDENTITY: Final = 0
_FRAMES: Final = 1
_COEFFICIENTS: Final = 2
_MATERIALS: Final = 3

_WORDS: Final = 20
"""Floats of a triangle's coefficients: 18, and 2 that fill its last texel"""

_TRIANGLES: Final = 1 << 14
"""Triangles of a piece of work"""


class InterpolantPass:
    """Radiance or irradiance of what an identity pass has found, evaluated once a pixel."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = context.program(
            vertex_shader=load_shader("screen.vert"), fragment_shader=load_shader("interpolant.frag")
        )
        self._screen = context.vertex_array(self._program, [])

    def draw(
        self,
        scene: GpuMesh,
        mesh: InterpolantMesh,
        viewpoint: Viewpoint,
        identity: Target,
        target: Target,
        *,
        is_linear: bool,
        is_radiance: bool,
    ) -> None:
        """Draw `mesh`, which `scene` holds; `identity` is what it shows from the same viewpoint.

        Linear: from values at triangles' corners ([H B.3.2], Gouraud shading with discontinuities).
        """
        surfaces = mesh.surfaces
        scene.use_texels(
            _FRAMES, Texel.WORDS, "frames", (mesh.position, mesh.triangles, mesh.patch, surfaces),
            lambda: frame_records(local_positions(mesh), mesh.triangles, triangle_patches(mesh)),
        )  # fmt: skip
        scene.use_texels(
            _COEFFICIENTS, Texel.FLOATS, "linear" if is_linear else "quadratic", (mesh.coefficients,),
            lambda: (_linear_texels if is_linear else _quadratic_texels)(mesh.coefficients),
        )  # fmt: skip
        scene.use_texels(
            _MATERIALS, Texel.FLOATS, "materials", (surfaces,), lambda: _material_texels(surfaces)
        )
        identity.texture.use(_IDENTITY)
        self._look(viewpoint, target.size)
        self._set("is_radiance", is_radiance)
        target.framebuffer.use()
        self._context.enable_only(moderngl.NOTHING)
        self._screen.render(vertices=3)

    def release(self) -> None:
        """Give the program back; the context must be current."""
        self._screen.release()
        self._program.release()

    def _look(self, viewpoint: Viewpoint, size: tuple[int, int]) -> None:
        rays = viewpoint.projection.rays(size, viewpoint.jitter)
        self._set("eye", tuple(viewpoint.projection.eye.tolist()))
        self._set("first", tuple(rays.first.tolist()))
        self._set("across", tuple(rays.across.tolist()))
        self._set("down", tuple(rays.down.tolist()))

    def _set(self, name: str, value: bool | tuple[float, ...]) -> None:
        uniform = self._program[name]
        assert isinstance(uniform, moderngl.Uniform)
        uniform.value = value


def _material_texels(surfaces: Surfaces) -> Float32Array:
    """(p, 8): reflectance and emission of patches over pi, each with a fourth number that is not used."""
    texels = np.zeros((surfaces.patch_count, 2, 4), dtype=np.float32)
    texels[:, 0, :3] = surfaces.reflectance / np.pi
    texels[:, 1, :3] = surfaces.emission / np.pi
    return texels.reshape(-1, 8)


def _quadratic_texels(coefficients: Float32Array) -> Float32Array:
    """(t, 20): `coefficients` (t, 6, 3) in whole texels."""
    texels = np.zeros((len(coefficients), _WORDS), dtype=np.float32)
    run_chunks(
        lambda start, stop: _copy_quadratics(start, stop, coefficients, texels), len(texels), _TRIANGLES
    )
    return texels


def _linear_texels(coefficients: Float32Array) -> Float32Array:
    """(t, 20): functions that are linear between the values of `coefficients` (t, 6, 3) at corners."""
    texels = np.zeros((len(coefficients), _WORDS), dtype=np.float32)
    run_chunks(lambda start, stop: _join_corners(start, stop, coefficients, texels), len(texels), _TRIANGLES)
    return texels


@kernel
def _copy_quadratics(start: int, stop: int, coefficients: Float32Array, texels: Float32Array) -> None:
    for k in range(start, stop):
        for term in range(6):
            for c in range(3):
                texels[k, 3 * term + c] = coefficients[k, term, c]


@kernel
def _join_corners(start: int, stop: int, coefficients: Float32Array, texels: Float32Array) -> None:
    for k in range(start, stop):
        for c in range(3):
            f = coefficients[k, 5, c]
            # As in frames of the quadratics themselves, irradiance is not negative.
            at_a = max(f, np.float32(0.0))
            at_b = max(coefficients[k, 0, c] + coefficients[k, 2, c] + f, np.float32(0.0))
            at_c = max(coefficients[k, 3, c] + coefficients[k, 4, c] + f, np.float32(0.0))
            texels[k, 6 + c] = at_b - at_a
            texels[k, 12 + c] = at_c - at_a
            texels[k, 15 + c] = at_a
