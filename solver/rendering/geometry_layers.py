"""What pixels show, from the triangles that they show: exact to float64, whatever the depth buffer holds.

OpenGL decides which triangle a pixel shows. The point that it shows is where the ray through the
pixel's centre meets the plane of the triangle's patch. `identity` (h, w) holds triangles of the mesh, or -1
where a pixel shows nothing. It is a frame of the camera, or a piece of one whose first pixel is in the row
and the column that `corner` says.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.geometry.scene import Camera
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.rendering.meshes import DrawnMesh, local_positions, triangle_patches
from solver.rendering.projection import PixelRays, Projection, half_extents
from solver.rendering.triangle_frames import locate
from solver.types import Float32Array, FloatArray, IntArray, Points, Vector

_ROWS: Final = 64
"""Rows of a piece of work"""


def leaf_ids(identity: IntArray, mesh: DrawnMesh) -> IntArray:
    """Leaf that each pixel shows, (h, w), or -1."""
    return _look_up(identity, mesh.leaf)


def patches(identity: IntArray, mesh: DrawnMesh) -> IntArray:
    """Patch that each pixel shows, (h, w), or -1."""
    return _look_up(identity, triangle_patches(mesh))


def object_ids(identity: IntArray, mesh: DrawnMesh) -> IntArray:
    """Index into `surfaces.object_ids` of what each pixel shows, (h, w), or -1."""
    return _look_up(patches(identity, mesh), mesh.surfaces.object)


def normals(identity: IntArray, mesh: DrawnMesh) -> Float32Array:
    """Unit normals of the fronts of what each pixel shows, (h, w, 3); 0 where it shows nothing."""
    table = np.concatenate([mesh.surfaces.normal, np.zeros((1, 3))]).astype(np.float32)
    return table[patches(identity, mesh)]


def errors(identity: IntArray, mesh: InterpolantMesh) -> Float32Array:
    """Estimated errors of the triangles that pixels show, (h, w) W/m2; 0 where a pixel shows nothing."""
    return np.append(mesh.error, np.float32(0.0)).astype(np.float32)[identity]


def barycentrics(
    identity: IntArray, mesh: DrawnMesh, camera: Camera, corner: tuple[int, int] = (0, 0)
) -> FloatArray:
    """Weights (h, w, 3) of a triangle's corners in the point that each pixel shows; 0 where it shows nothing.

    None is negative, and their sum is 1.
    """
    eye, rays = _look(mesh, camera, corner)
    st = locate(identity, local_positions(mesh), mesh.triangles, eye, rays)
    first = np.where(identity >= 0, np.maximum(1.0 - st[:, :, 0] - st[:, :, 1], 0.0), 0.0)
    return np.concatenate([first[:, :, None], st], axis=-1)


def depths(
    identity: IntArray, mesh: DrawnMesh, camera: Camera, corner: tuple[int, int] = (0, 0)
) -> FloatArray:
    """Distances along the viewing direction, (h, w) metres; infinite where a pixel shows nothing."""
    surfaces = mesh.surfaces
    eye, rays = _look(mesh, camera, corner)
    patch = patches(identity, mesh)
    position = local_positions(mesh)
    origin = (surfaces.corners[:, 0] - surfaces.center) / surfaces.size
    depth = np.empty(identity.shape)
    run_chunks(
        lambda start, stop: _measure(
            start, stop, identity, mesh.triangles, position, patch, origin, surfaces.normal,
            eye, camera.basis()[2], rays, depth,
        ),
        len(identity),
        _ROWS,
    )  # fmt: skip
    return surfaces.size * depth


def positions(
    identity: IntArray, mesh: DrawnMesh, camera: Camera, corner: tuple[int, int] = (0, 0)
) -> FloatArray:
    """World points that pixels show, (h, w, 3) metres; NaN where a pixel shows nothing."""
    depth = depths(identity, mesh, camera, corner)
    depth[np.isinf(depth)] = np.nan
    first, across, down = _look(mesh, camera, corner)[1]
    height, width = identity.shape
    directions = (first + np.arange(width)[:, None] * across) + np.arange(height)[:, None, None] * down
    directions *= depth[:, :, None]
    directions += camera.eye
    return directions


def rays(camera: Camera) -> FloatArray:
    """Directions (h, w, 3) through pixels' centres, 1 long along the viewing direction."""
    right, up, forward = camera.basis()
    across, upwards = half_extents(camera)
    x = (2.0 * np.arange(camera.width) + 1.0) / camera.width - 1.0
    y = (2.0 * np.arange(camera.height) + 1.0) / camera.height - 1.0
    return np.asarray(forward + x[None, :, None] * (across * right) - y[:, None, None] * (upwards * up))


def _look(mesh: DrawnMesh, camera: Camera, corner: tuple[int, int]) -> tuple[Vector, PixelRays]:
    """The eye in local coordinates, and the rays of the piece of the frame that begins at `corner`."""
    seen = Projection.of(camera, mesh.surfaces)
    whole = seen.rays((camera.width, camera.height))
    first = whole.first + corner[0] * whole.down + corner[1] * whole.across
    return seen.eye, whole._replace(first=first)


def _look_up(index: IntArray, table: IntArray) -> IntArray:
    """`table` at `index`; -1 at -1."""
    return np.append(table, np.int32(-1)).astype(np.int32)[index]


@kernel
def _measure(
    start: int,
    stop: int,
    identity: IntArray,
    triangles: IntArray,
    position: Points,
    patch: IntArray,
    origin: Points,
    normal: FloatArray,
    eye: Vector,
    forward: Vector,
    rays: PixelRays,
    depth: FloatArray,
) -> None:
    """Depths of the rows from `start` to `stop`."""
    for row in range(start, stop):
        for column in range(identity.shape[1]):
            shown = identity[row, column]
            if shown < 0:
                depth[row, column] = np.inf
                continue
            p = patch[row, column]
            above = 0.0
            falling = 0.0
            for axis in range(3):
                ray = rays.first[axis] + column * rays.across[axis] + row * rays.down[axis]
                above += (eye[axis] - origin[p, axis]) * normal[p, axis]
                falling -= ray * normal[p, axis]
            # A pixel at the rim of a patch that is seen edge on can miss it by what the rasteriser has
            # rounded, and its plane by far: depths stay near those of the triangle's corners, no further
            # from them than these from one another.
            a = triangles[shown, 0]
            low = np.inf
            high = -np.inf
            reach = 0.0
            for k in range(3):
                v = triangles[shown, k]
                far = 0.0
                apart = 0.0
                for axis in range(3):
                    far += (position[v, axis] - eye[axis]) * forward[axis]
                    apart += (position[v, axis] - position[a, axis]) ** 2
                low = min(low, far)
                high = max(high, far)
                reach = max(reach, np.sqrt(apart))
            met = above / falling if falling != 0.0 else low
            depth[row, column] = min(max(met, low - reach, 0.0), max(high, 0.0) + reach)
