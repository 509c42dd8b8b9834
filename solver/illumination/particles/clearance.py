"""Virtual lights that stand clear of walls, so that float32 tells on which side of them they are.

What a light sees is traced by rays that leave its surface by `RAY_OFFSET`, from a place that is rounded to
float32. Closer to a wall than that, on the floor beside it, they may start behind it: the wall is not seen
then, and hides nothing. A light that close is moved away along its own surface, by no more than a few
millionths of the scene's size. On which side it stays is for its patch to say, where that lies on one side of
the wall's plane, and else for its own place, in float64.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.lights import VirtualLights
from solver.kernels import kernel
from solver.tolerances import RAY_OFFSET, SIDE
from solver.types import BoolArray, Corners, FloatArray, IntArray, Points

CLEARANCE: Final = 2.0 * RAY_OFFSET
"""Distance from walls that lights keep, over the scene's size"""

_LEAST_SLANT: Final = 0.01
"""Squared sine of the angle between two planes below which they pass for parallel: a light's own plane has
no direction then that leads away from the other"""

_SWEEPS: Final = 3
"""Away from one wall may lead towards another: in corners."""


def clear_of_walls(lights: VirtualLights, surfaces: Surfaces) -> VirtualLights:
    """`lights`, on their patches, with those that touch other faces moved away from them by `CLEARANCE`.

    Images are left where they are: they shine from their mirrors on.
    """
    position = lights.position.copy()
    corners = surfaces.corners
    _move(
        position, lights.normal, lights.patch, lights.mirror < 0, corners, surfaces.normal, surfaces.side,
        corners.min(axis=1), corners.max(axis=1), CLEARANCE * surfaces.size, SIDE * surfaces.size,
    )  # fmt: skip
    return replace(lights, position=position)


@kernel
def _move(
    position: Points,
    own_normal: FloatArray,
    own: IntArray,
    moves: BoolArray,
    corners: Corners,
    normal: FloatArray,
    side: IntArray,
    low: FloatArray,
    high: FloatArray,
    clearance: float,
    on_plane: float,
) -> None:
    for light in range(len(position)):
        if not moves[light]:
            continue
        for _ in range(_SWEEPS):
            for p in range(len(corners)):
                if side[p] != 0 or not _is_near(position[light], low[p], high[p], clearance):
                    continue
                height = along = 0.0
                for axis in range(3):
                    height += (position[light, axis] - corners[p, 0, axis]) * normal[p, axis]
                    along += own_normal[light, axis] * normal[p, axis]
                slant = 1.0 - along * along
                if abs(height) >= clearance or slant < _LEAST_SLANT:
                    continue
                # Which side the whole of its own patch is on, if it is.
                lowest, highest = 0.0, 0.0
                for corner in range(4):
                    at = 0.0
                    for axis in range(3):
                        at += (corners[own[light], corner, axis] - corners[p, 0, axis]) * normal[p, axis]
                    lowest, highest = min(lowest, at), max(highest, at)
                before = height >= 0.0
                if lowest >= -on_plane or highest <= on_plane:
                    before = highest > -lowest
                step = ((clearance if before else -clearance) - height) / slant
                for axis in range(3):
                    position[light, axis] += step * (normal[p, axis] - along * own_normal[light, axis])


@kernel
def _is_near(point: FloatArray, low: FloatArray, high: FloatArray, apart: float) -> bool:
    """Whether a point is within a box, or not as far as `apart` from it."""
    is_near = True
    for axis in range(3):
        is_near = is_near and low[axis] - apart <= point[axis] <= high[axis] + apart
    return is_near
