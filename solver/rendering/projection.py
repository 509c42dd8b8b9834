"""A camera in the local coordinates of a scene, and where in a pixel it looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

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


class PixelRays(NamedTuple):
    """Rays through pixels, 1 long along the viewing direction; an arrays' tuple, as kernels take it."""

    first: Vector
    """(3,) through the centre of the first pixel"""
    across: Vector
    """(3,) what a pixel further to the right adds"""
    down: Vector
    """(3,) what a pixel further down adds"""


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

    def rays(self, size: tuple[int, int], jitter: tuple[float, float] = (0.0, 0.0)) -> PixelRays:
        """Rays through pixels of a frame of `size` (width, height).

        `jitter` is how far right and down the picture has been moved against them, in clip space.
        """
        right = self.right / (self.right @ self.right)
        down = self.down / (self.down @ self.down)
        across_pixel, down_pixel = 2.0 / size[0], 2.0 / size[1]
        x = 0.5 * across_pixel - 1.0 - jitter[0]
        y = 0.5 * down_pixel - 1.0 - jitter[1]
        return PixelRays(self.forward + x * right + y * down, across_pixel * right, down_pixel * down)


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
