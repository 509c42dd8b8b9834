"""A camera in the local coordinates of a scene, and where in a pixel it looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces
from solver.types import BoolArray, FloatArray, IntArray, Vector

NEAR: Final = 2.0**-24
"""Distance of the near plane over the scene's size: where float32 ends. Depth keeps its digits all the same
(see `entry_points`), so that nothing is gained by a plane that is further away."""

FRONT: Final = 0
BACK: Final = 1
"""The black back of a one-sided patch"""
HIDDEN: Final = 2
"""The back of a patch of a two-sided face, which has a patch of its own there"""


@dataclass(frozen=True, eq=False)
class Projection:
    """What the shaders know of a camera."""

    eye: Vector
    """(3,) local coordinates"""
    right: Vector
    """(3,) over the tangent of half the horizontal angle of view"""
    down: Vector
    """(3,) over the tangent of half the vertical angle of view"""
    forward: Vector
    """(3,) unit"""

    @staticmethod
    def of(camera: Camera, surfaces: Surfaces) -> Projection:
        """The projection of `camera` looking at `surfaces`."""
        right, up, forward = camera.basis()
        across, upwards = half_extents(camera)
        return Projection(
            (camera.eye - surfaces.center) / surfaces.size, right / across, -up / upwards, forward
        )


def half_extents(camera: Camera) -> tuple[float, float]:
    """Tangents of half the horizontal and vertical angles of view."""
    vertical = float(np.tan(np.radians(camera.vertical_fov) / 2.0))
    return vertical * camera.width / camera.height, vertical


def facings(surfaces: Surfaces, eye: Vector) -> IntArray:
    """FRONT, BACK or HIDDEN for each patch (p,), seen from `eye` (3,) in metres.

    Decided once for a patch, in float64: a rasteriser that decides by the winding of small triangles that
    it has rounded shows black specks.
    """
    height = np.einsum("ij,ij->i", eye - surfaces.corners[:, 0], surfaces.normal)
    behind = np.where(is_two_sided(surfaces), np.int32(HIDDEN), np.int32(BACK))
    return np.where(height > 0.0, np.int32(FRONT), behind).astype(np.int32)


def is_two_sided(surfaces: Surfaces) -> BoolArray:
    """Whether each patch (p,) is one of the two of a two-sided face."""
    both = surfaces.triangle_patch[surfaces.triangle_patch[:, 1] >= 0]
    found = np.zeros(surfaces.patch_count, dtype=np.bool_)
    found[both.ravel()] = True
    return found


def pixel_pattern(samples: int) -> FloatArray:
    """Where in a pixel its samples lie, (samples, 2) in (-1/2, 1/2), with a mean of 0: a Hammersley set.

    One sample is the pixel's centre.
    """
    index = np.arange(samples)
    inverse = np.zeros(samples)
    digit = 0.5
    rest = index.copy()
    while rest.any():
        inverse += digit * (rest & 1)
        rest >>= 1
        digit *= 0.5
    # Where `samples` is no power of 2, the radical inverses lean to one side: they are centred by their mean.
    across = (index + 0.5) / samples - 0.5
    down = inverse - inverse.mean()
    return np.stack([across, down], axis=-1)
