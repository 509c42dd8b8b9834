"""What a pixel shows, with the light that the frame shows there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.engine.drawing import Drawing
from solver.engine.solution import Solution
from solver.geometry.scene import Camera
from solver.illumination.interpolation.evaluate import evaluate_interpolants
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.picking import Pick
from solver.rendering.tessellation import RenderMesh
from solver.types import LUMINANCE_WEIGHTS, Vector


@dataclass(frozen=True, eq=False)
class PickedPoint:
    """The point that a pixel's centre shows."""

    seen: Pick
    """Its triangle is one of the mesh that is drawn"""
    element: int
    """The leaf of the element hierarchy that it lies on"""
    has_interpolant: bool
    """Whether the mesh that is drawn is that of the triangulation"""
    front: bool
    """Whether the front of the face is seen; nothing comes from a back"""
    depth: float
    """m along the viewing direction"""
    irradiance: Vector
    """(3,) W/m2"""
    illuminance: float
    """lux"""
    radiosity: Vector
    """(3,) W/m2"""


@dataclass(frozen=True, eq=False)
class PickResult:
    """What a pixel shows, if anything."""

    revision: int
    point: PickedPoint | None


def pick_point(
    solution: Solution, mesh: InterpolantMesh | None, drawing: Drawing, camera: Camera, x: int, y: int
) -> PickedPoint | None:
    """What the pixel in column `x` and row `y` shows, both from 0 at the top left; None for nothing.

    `mesh` are the interpolants; None: the solution itself is drawn. Raises SceneError naming x or y for a
    pixel outside the frame, LimitExceededError, RenderingUnavailableError.
    """
    world = solution.world
    surfaces = world.surfaces
    drawn = drawing.mesh_of(world, solution.field()) if mesh is None else mesh
    seen = drawing.require_device().pick(drawn, camera, x, y)
    if seen is None:
        return None
    # Decided for the whole patch, as frames do, so that a pixel at a rim is on no other side.
    front = bool((camera.eye - surfaces.corners[seen.patch, 0]) @ surfaces.normal[seen.patch] > 0.0)
    irradiance, radiosity = np.zeros(3), np.zeros(3)
    if front:
        irradiance = _irradiance(drawn, seen)
        radiosity = surfaces.emission[seen.patch] + surfaces.reflectance[seen.patch] * irradiance
    return PickedPoint(
        seen=seen,
        element=int(solution.solver.state.tree.leaves[seen.leaf]),
        has_interpolant=mesh is not None,
        front=front,
        depth=float((seen.position - camera.eye) @ camera.basis()[2]),
        irradiance=irradiance,
        illuminance=float(world.scene.luminous_efficacy * (irradiance @ LUMINANCE_WEIGHTS)),
        radiosity=radiosity,
    )


def _irradiance(mesh: RenderMesh | InterpolantMesh, seen: Pick) -> Vector:
    """(3,) W/m2 as the mesh is shaded."""
    if isinstance(mesh, InterpolantMesh):
        triangle = np.array([seen.triangle], dtype=np.int32)
        return np.asarray(evaluate_interpolants(mesh, triangle, seen.barycentric[None, 1:])[0])
    corners = mesh.irradiance[mesh.triangles[seen.triangle]].astype(np.float64)
    return np.asarray(seen.barycentric @ corners)
