"""What is drawn: meshes of a field's leaves or of interpolants, and what passes and layers ask of either.

Local coordinates are those of `tessellation`: centred on the scene and divided by its size.
"""

from __future__ import annotations

from typing import Protocol, TypeAlias

import numpy as np

from solver.errors import SolverError
from solver.geometry.surfaces import Surfaces
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.tessellation import RenderMesh
from solver.types import FloatArray, IntArray, Points

DrawnMesh: TypeAlias = RenderMesh | InterpolantMesh


class Triangulation(Protocol):
    """What the meshes have in common, apart from positions: local in one, in metres in the other."""

    @property
    def surfaces(self) -> Surfaces:
        """What the triangles lie on"""

    @property
    def patch(self) -> IntArray:
        """(v,) patch of each vertex"""

    @property
    def triangles(self) -> IntArray:
        """(t, 3) vertices, counter-clockwise from the front"""

    @property
    def leaf(self) -> IntArray:
        """(t,) leaf of each triangle"""


class NotInMeshError(SolverError):
    """A frame is asked for that only interpolants give, of a mesh that has none."""

    def __init__(self, what: str) -> None:
        self.what = what
        super().__init__(f"{what}: only a mesh of interpolants has it")


def local_positions(mesh: DrawnMesh) -> Points:
    """(v, 3) local coordinates of the vertices."""
    if isinstance(mesh, RenderMesh):
        return mesh.position.astype(np.float64)
    return np.asarray((mesh.position - mesh.surfaces.center) / mesh.surfaces.size)


def triangle_patches(mesh: Triangulation) -> IntArray:
    """(t,) patch of each triangle."""
    return mesh.patch[mesh.triangles[:, 0]]


def leaf_radiance(mesh: InterpolantMesh) -> FloatArray:
    """(n, 3) W/(m2 sr), (E + rho H) / pi of the field's leaves; 0 for one without triangles."""
    radiance = np.zeros_like(mesh.leaf_irradiance)
    # All triangles of a leaf lie on one patch.
    leaf, first = np.unique(mesh.leaf, return_index=True)
    patch = mesh.patch[mesh.triangles[first, 0]]
    reflected = mesh.surfaces.reflectance[patch] * mesh.leaf_irradiance[leaf]
    radiance[leaf] = (mesh.surfaces.emission[patch] + reflected) / np.pi
    return radiance
