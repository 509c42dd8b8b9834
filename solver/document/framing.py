"""Where to stand to see a scene: the default camera.

The scene is tried from outside, all around it, then from the corners inside its bounding box. A
coarse grid of rays tells what each view shows. From outside, a view must show more lit fronts than
black backs; a closed room shows only backs, so it is looked at from within.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.scene import Camera, Scene
from solver.geometry.surfaces import Surfaces, flatten
from solver.types import FloatArray, Points, Vector
from solver.visibility.rays import RayScene

_GRID: Final = (32, 24)
"""Rays across and down a trial view."""
_HEIGHTS: Final = (0.0, 0.45)
"""Tangents of the angles at which the scene is looked down upon from outside."""
_INSIDE: Final = 0.8
"""How far from the middle towards a corner of the bounding box the inner views stand."""


@dataclass(frozen=True)
class _View:
    eye: Vector
    target: Vector
    fronts: int
    """Rays that meet a front first"""
    backs: int
    """Rays that meet a black back first"""


def middle(scene: Scene) -> Vector:
    """(3,) middle of the scene's bounding box, metres."""
    return flatten(scene).center


def overview(scene: Scene, vertical_fov: float, aspect: float) -> tuple[Vector, Vector]:
    """Eye and target, (3,) metres each, of a view of the whole scene.

    `vertical_fov` in degrees, `aspect` is width over height; up is z.
    """
    surfaces = flatten(scene)
    rays = RayScene(surfaces.triangles, surfaces.center, surfaces.size)

    def look(eye: Vector) -> _View:
        return _try(surfaces, rays, eye, vertical_fov, aspect)

    outside = [look(eye) for eye in _outer_eyes(surfaces, vertical_fov, aspect)]
    chosen = max(outside, key=lambda view: view.fronts)
    if chosen.fronts < chosen.backs:
        inside = [look(eye) for eye in _inner_eyes(surfaces)]
        chosen = max([chosen, *inside], key=lambda view: view.fronts)
    return chosen.eye, chosen.target


def _outer_eyes(surfaces: Surfaces, vertical_fov: float, aspect: float) -> Points:
    """Eyes around the scene, far enough for its bounding sphere to be in view."""
    half = np.arctan(np.tan(np.radians(vertical_fov) / 2) * min(aspect, 1.0))
    distance = 0.5 * surfaces.size / np.sin(half)
    angles = np.arange(8) * (np.pi / 4) - np.pi / 2
    around = [(np.cos(a), np.sin(a), height) for height in _HEIGHTS for a in angles]
    directions = np.array([*around, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(surfaces.center + distance * directions)


def _inner_eyes(surfaces: Surfaces) -> Points:
    """Eyes near the four upper corners of the bounding box."""
    corners = surfaces.corners.reshape(-1, 3)
    half = 0.5 * np.ptp(corners, axis=0) if len(corners) else np.zeros(3)
    signs = np.array([(-1.0, -1.0, 0.3), (1.0, -1.0, 0.3), (1.0, 1.0, 0.3), (-1.0, 1.0, 0.3)])
    return np.asarray(surfaces.center + _INSIDE * signs * half)


def _try(surfaces: Surfaces, rays: RayScene, eye: Vector, vertical_fov: float, aspect: float) -> _View:
    directions = _grid(eye, surfaces.center, vertical_fov, aspect)
    hits = rays.intersect(np.tile(eye, (len(directions), 1)), directions)
    found = hits.triangle >= 0
    triangles = surfaces.triangles[hits.triangle[found]]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    from_behind = (np.einsum("ij,ij->i", normals, directions[found]) > 0.0).astype(int)
    lit = surfaces.triangle_patch[hits.triangle[found], from_behind] >= 0
    fronts = int(np.count_nonzero(lit))
    return _View(eye, surfaces.center, fronts, len(lit) - fronts)


def _grid(eye: Vector, target: Vector, vertical_fov: float, aspect: float) -> FloatArray:
    """Directions (n, 3) through a grid over the frame."""
    across, down = _GRID
    up = np.array([0.0, 0.0, 1.0])
    if np.allclose(np.cross(target - eye, up), 0.0):
        up = np.array([0.0, 1.0, 0.0])
    right, above, forward = Camera(eye, target, up, vertical_fov, across, down).basis()
    half = np.tan(np.radians(vertical_fov) / 2)
    x = ((np.arange(across) + 0.5) / across * 2 - 1) * half * aspect
    y = ((np.arange(down) + 0.5) / down * 2 - 1) * half
    return np.asarray((forward + x[:, None, None] * right + y[None, :, None] * above).reshape(-1, 3))
