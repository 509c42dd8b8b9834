"""Meshes of interpolants made by hand: those of radiosity fields, with quadratics of one's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces
from solver.illumination.interpolation.evaluate import evaluate_interpolants
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.projection import FRONT, facings
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.types import BoolArray, Float32Array, FloatArray
from tests.rendering.fields import Function, Split, build_field, constant


def interpolants(mesh: RenderMesh, coefficients: Float32Array) -> InterpolantMesh:
    """The triangles of `mesh` with `coefficients` (t, 6, 3)."""
    count = len(mesh.triangles)
    return InterpolantMesh(
        surfaces=mesh.surfaces,
        position=mesh.position.astype(np.float64) * mesh.surfaces.size + mesh.surfaces.center,
        patch=mesh.patch,
        triangles=mesh.triangles,
        leaf=mesh.leaf,
        coefficients=coefficients,
        error=np.random.default_rng(count).uniform(0.1, 1.0, count).astype(np.float32),
        is_fine=np.ones(count, dtype=np.bool_),
        leaf_irradiance=mesh.field.irradiance,
    )


def random_coefficients(seed: int, count: int) -> Float32Array:
    """Quadratics that know nothing of one another; some dip below 0."""
    made = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 6, 3)).astype(np.float32)
    made[:, 5] += 1.0
    return made


def random_mesh(surfaces: Surfaces, split: Split, seed: int) -> InterpolantMesh:
    """`surfaces` split into leaves, and random quadratics over them."""
    mesh = Tessellator(surfaces).mesh(build_field(surfaces, split, constant(1.0)))
    return interpolants(mesh, random_coefficients(seed, len(mesh.triangles)))


def fitted(mesh: InterpolantMesh, function: Function) -> InterpolantMesh:
    """`mesh` with the quadratics through `function` at vertices and edges' midpoints [H 3.3]."""
    a, b, c = (mesh.position[mesh.triangles[:, k]] for k in range(3))
    r = [function(p) for p in (a, 0.5 * (a + b), b, 0.5 * (b + c), c, 0.5 * (c + a))]
    quadratics = [
        2.0 * r[0] - 4.0 * r[1] + 2.0 * r[2],
        2.0 * (2.0 * r[0] - 2.0 * r[1] + 2.0 * r[3] - 2.0 * r[5]),
        -3.0 * r[0] + 4.0 * r[1] - r[2],
        2.0 * r[0] + 2.0 * r[4] - 4.0 * r[5],
        -3.0 * r[0] - r[4] + 4.0 * r[5],
        r[0],
    ]
    return replace(mesh, coefficients=np.stack(quadratics, axis=1).astype(np.float32))


def is_lit(renderer: FrameRenderer, mesh: InterpolantMesh, view: Camera) -> BoolArray:
    """Whether each pixel shows the front of something, (h, w)."""
    shown = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.TRIANGLE)
    patch = mesh.patch[mesh.triangles[shown, 0]]
    return np.asarray((shown >= 0) & (facings(mesh.surfaces, view.eye)[patch] == FRONT))


def by_cpu(renderer: FrameRenderer, mesh: InterpolantMesh, view: Camera, layer: Layer) -> FloatArray:
    """The frame as the CPU evaluates it where OpenGL says that triangles are, (h, w, 3)."""
    shown = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.TRIANGLE)
    weights = renderer.draw(mesh, view, Shading.INTERPOLANT, Layer.BARYCENTRIC)
    points = weights[:, :, 1:].reshape(-1, 2).astype(np.float64)
    light = evaluate_interpolants(mesh, shown.ravel(), points).reshape(*shown.shape, 3)
    if layer is Layer.RADIANCE:
        patch = mesh.patch[mesh.triangles[shown, 0]]
        light = (mesh.surfaces.emission[patch] + mesh.surfaces.reflectance[patch] * light) / np.pi
    return np.where(is_lit(renderer, mesh, view)[:, :, None], light, 0.0)
