"""What pixels show, from the triangles that they show: exact to float64, whatever the depth buffer holds.

OpenGL decides which triangle a pixel shows. The point that it shows is where the ray through the
pixel's centre meets the plane of the triangle's patch.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.geometry.scene import Camera
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.rendering.projection import half_extents
from solver.rendering.tessellation import RenderMesh
from solver.types import Corners, Float32Array, FloatArray, IntArray, Vector

_ROWS: Final = 64
"""Rows of a piece of work"""


def leaf_ids(identity: IntArray, mesh: RenderMesh) -> IntArray:
    """Leaf that each pixel shows, (h, w), or -1; `identity` (h, w) holds triangles, or -1."""
    return _look_up(identity, mesh.leaf)


def object_ids(identity: IntArray, mesh: RenderMesh) -> IntArray:
    """Index into `surfaces.object_ids` of what each pixel shows, (h, w), or -1."""
    return _look_up(leaf_ids(identity, mesh), mesh.surfaces.object[mesh.field.patch])


def normals(identity: IntArray, mesh: RenderMesh) -> Float32Array:
    """Unit normals of the fronts of what each pixel shows, (h, w, 3); 0 where it shows nothing."""
    patch = _look_up(leaf_ids(identity, mesh), mesh.field.patch)
    table = np.concatenate([mesh.surfaces.normal, np.zeros((1, 3))]).astype(np.float32)
    return table[patch]


def depths(identity: IntArray, mesh: RenderMesh, camera: Camera) -> FloatArray:
    """Distances along the viewing direction, (h, w) metres; infinite where a pixel shows nothing."""
    leaf = leaf_ids(identity, mesh)
    right, up, forward = camera.basis()
    across, upwards = half_extents(camera)
    depth = np.empty(leaf.shape)
    field, surfaces = mesh.field, mesh.surfaces

    def measure(start: int, stop: int) -> None:
        _measure(
            start, stop, leaf, field.patch, field.corners, surfaces.normal,
            camera.eye, across * right, -upwards * up, forward, depth,
        )  # fmt: skip

    run_chunks(measure, len(leaf), _ROWS)
    return depth


def positions(identity: IntArray, mesh: RenderMesh, camera: Camera) -> FloatArray:
    """World points that pixels show, (h, w, 3) metres; NaN where a pixel shows nothing."""
    depth = depths(identity, mesh, camera)
    depth[np.isinf(depth)] = np.nan
    return np.asarray(camera.eye + depth[:, :, None] * rays(camera))


def rays(camera: Camera) -> FloatArray:
    """Directions (h, w, 3) through pixels' centres, 1 long along the viewing direction."""
    right, up, forward = camera.basis()
    across, upwards = half_extents(camera)
    x = (2.0 * np.arange(camera.width) + 1.0) / camera.width - 1.0
    y = (2.0 * np.arange(camera.height) + 1.0) / camera.height - 1.0
    return np.asarray(forward + x[None, :, None] * (across * right) - y[:, None, None] * (upwards * up))


def _look_up(index: IntArray, table: IntArray) -> IntArray:
    """`table` at `index`; -1 at -1."""
    return np.append(table, np.int32(-1)).astype(np.int32)[index]


@kernel
def _measure(
    start: int,
    stop: int,
    leaf: IntArray,
    patch: IntArray,
    corners: Corners,
    normal: FloatArray,
    eye: Vector,
    right: Vector,
    down: Vector,
    forward: Vector,
    depth: FloatArray,
) -> None:
    """Depths of the rows from `start` to `stop`."""
    height, width = leaf.shape
    for row in range(start, stop):
        y = (2.0 * row + 1.0) / height - 1.0
        for column in range(width):
            shown = leaf[row, column]
            if shown < 0:
                depth[row, column] = np.inf
                continue
            x = (2.0 * column + 1.0) / width - 1.0
            above = 0.0
            falling = 0.0
            for axis in range(3):
                n = normal[patch[shown], axis]
                above += (eye[axis] - corners[shown, 0, axis]) * n
                falling -= (forward[axis] + x * right[axis] + y * down[axis]) * n
            # A pixel at the rim of a patch that is seen edge on can miss it by what the rasteriser has
            # rounded, and its plane by far: depths stay within those of the leaf's corners.
            low = np.inf
            high = 0.0
            for k in range(4):
                far = 0.0
                for axis in range(3):
                    far += (corners[shown, k, axis] - eye[axis]) * forward[axis]
                low = min(low, far)
                high = max(high, far)
            met = above / falling if falling != 0.0 else low
            depth[row, column] = min(max(met, low, 0.0), high)
