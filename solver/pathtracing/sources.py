"""Where paths begin: in the pixels of a camera, at given points, or spread over elements."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from solver.geometry.scene import Camera
from solver.kernels import kernel
from solver.pathtracing.connect import cast_shadow_ray
from solver.pathtracing.paths import Paths, ShadowRays
from solver.pathtracing.sampling import pair, stream_of, triangle_weights
from solver.pathtracing.tables import Emitters, ShadingTables, split_corners
from solver.pathtracing.walk import leave_vertex
from solver.types import Corners, FloatArray, Int64Array, IntArray, Points


@dataclass(frozen=True)
class Batch:
    """A run of paths of one pass: path k is sample k mod `samples` of item `first_item` + k // `samples`."""

    first_item: int
    samples: int
    key: np.uint64
    """Hashed seed of the pass."""


class Source(Protocol):
    """One way to begin paths."""

    @property
    def item_count(self) -> int:
        """Number of estimates."""
        ...

    def begin(
        self,
        batch: Batch,
        start: int,
        stop: int,
        tables: ShadingTables,
        emitters: Emitters,
        paths: Paths,
        alive: int,
        shadows: ShadowRays,
        cast: int,
        /,
    ) -> int:
        """Write paths [start, stop) of `batch` at rows from `alive` on, and their shadow rays from `cast`.

        Returns the number of shadow rays then in use.
        """
        ...


class CameraSource:
    """Pixels of a camera, row by row from the top, box filtered; the estimate is radiance."""

    def __init__(self, camera: Camera) -> None:
        right, up, forward = camera.basis()
        height = 2.0 * math.tan(0.5 * math.radians(camera.vertical_fov))
        side = height / camera.height
        self._width = camera.width
        self._eye = np.ascontiguousarray(camera.eye, dtype=np.float64)
        self._corner = forward + 0.5 * height * up - 0.5 * side * camera.width * right
        self._across = side * right
        self._down = -side * up
        self.item_count = camera.width * camera.height
        """Number of pixels."""

    def begin(
        self,
        batch: Batch,
        start: int,
        stop: int,
        _tables: ShadingTables,
        _emitters: Emitters,
        paths: Paths,
        alive: int,
        _shadows: ShadowRays,
        cast: int,
    ) -> int:
        """Write camera rays; they cast no shadow rays yet."""
        _begin_camera(
            start, stop, batch.first_item, batch.samples, batch.key,
            self._width, self._eye, self._corner, self._across, self._down, paths, alive,
        )  # fmt: skip
        return cast


@dataclass(frozen=True, eq=False)
class PointSource:
    """Points with normals; the estimate is irradiance."""

    positions: Points
    """(n, 3) metres"""
    normals: FloatArray
    """(n, 3) unit"""

    @property
    def item_count(self) -> int:
        """Number of points."""
        return len(self.positions)

    def begin(
        self,
        batch: Batch,
        start: int,
        stop: int,
        tables: ShadingTables,
        emitters: Emitters,
        paths: Paths,
        alive: int,
        shadows: ShadowRays,
        cast: int,
    ) -> int:
        """Write the rays that leave the points."""
        return _begin_points(
            start, stop, batch.first_item, batch.samples, batch.key,
            self.positions, self.normals, tables, emitters, paths, alive, shadows, cast,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ElementSource:
    """Planar elements, sampled uniformly by area; the estimate is mean irradiance."""

    triangles: FloatArray
    """(m, 3, 3) metres; those of one element follow one another"""
    first: Int64Array
    """(n + 1,) triangles of element k are first[k] to first[k + 1]"""
    share: FloatArray
    """(m,) part of its element's area that a triangle has"""
    normals: FloatArray
    """(n, 3) unit"""

    @staticmethod
    def of(corners: Corners, corner_count: IntArray, normals: FloatArray) -> ElementSource:
        """Elements (n, 4, 3) with unit normals (n, 3); a triangle repeats its last corner."""
        triangles, owner = split_corners(corners, corner_count)
        edges = triangles[:, 1:] - triangles[:, :1]
        area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=-1)
        total = np.bincount(owner, weights=area, minlength=len(corner_count))
        first = np.searchsorted(owner, np.arange(len(corner_count) + 1)).astype(np.int64)
        return ElementSource(triangles, first, area / total[owner], np.ascontiguousarray(normals))

    @property
    def item_count(self) -> int:
        """Number of elements."""
        return len(self.normals)

    def begin(
        self,
        batch: Batch,
        start: int,
        stop: int,
        tables: ShadingTables,
        emitters: Emitters,
        paths: Paths,
        alive: int,
        shadows: ShadowRays,
        cast: int,
    ) -> int:
        """Write the rays that leave points of the elements."""
        return _begin_elements(
            start, stop, batch.first_item, batch.samples, batch.key,
            self.triangles, self.first, self.share, self.normals,
            tables, emitters, paths, alive, shadows, cast,
        )  # fmt: skip


@kernel
def _begin_camera(
    start: int,
    stop: int,
    first_item: int,
    samples: int,
    key: np.uint64,
    width: int,
    eye: FloatArray,
    corner: FloatArray,
    across: FloatArray,
    down: FloatArray,
    paths: Paths,
    alive: int,
) -> None:
    """Rays from `eye` through the film: its top left is at `corner`, its pixels span `across` and `down`."""
    for path in range(start, stop):
        row = alive + path - start
        local, index = path // samples, np.uint64(path % samples)
        pixel = first_item + local
        stream = stream_of(key, pixel)
        u, v = pair(stream, index, 0)
        column, line = pixel % width + u, pixel // width + v
        dx = corner[0] + column * across[0] + line * down[0]
        dy = corner[1] + column * across[1] + line * down[1]
        dz = corner[2] + column * across[2] + line * down[2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        for axis in range(3):
            paths.origin[row, axis] = eye[axis]
            # L = B / pi.
            paths.throughput[row, axis] = 1.0 / math.pi
        paths.direction[row, 0] = dx / length
        paths.direction[row, 1] = dy / length
        paths.direction[row, 2] = dz / length
        paths.spread[row] = -1.0
        paths.item[row] = local
        paths.vertex[row] = 0
        paths.stream[row] = stream
        paths.sample[row] = index


@kernel
def _begin_points(
    start: int,
    stop: int,
    first_item: int,
    samples: int,
    key: np.uint64,
    positions: FloatArray,
    normals: FloatArray,
    tables: ShadingTables,
    emitters: Emitters,
    paths: Paths,
    alive: int,
    shadows: ShadowRays,
    cast: int,
) -> int:
    """Vertex 0 is the point itself."""
    for path in range(start, stop):
        row = alive + path - start
        local, index = path // samples, np.uint64(path % samples)
        item = first_item + local
        stream = stream_of(key, item)
        nx, ny, nz = normals[item, 0], normals[item, 1], normals[item, 2]
        x = positions[item, 0] + tables.offset * nx
        y = positions[item, 1] + tables.offset * ny
        z = positions[item, 2] + tables.offset * nz
        u, v = pair(stream, index, 1)
        cast = cast_shadow_ray(
            tables, emitters, shadows, cast, x, y, z, nx, ny, nz, 1.0, 1.0, 1.0, local, u, v
        )
        leave_vertex(paths, row, x, y, z, nx, ny, nz, 1.0, 1.0, 1.0, local, 0, stream, index)
    return cast


@kernel
def _begin_elements(
    start: int,
    stop: int,
    first_item: int,
    samples: int,
    key: np.uint64,
    triangles: FloatArray,
    first: Int64Array,
    share: FloatArray,
    normals: FloatArray,
    tables: ShadingTables,
    emitters: Emitters,
    paths: Paths,
    alive: int,
    shadows: ShadowRays,
    cast: int,
) -> int:
    """Vertex 0 is a point uniform over the element's area."""
    for path in range(start, stop):
        row = alive + path - start
        local, index = path // samples, np.uint64(path % samples)
        item = first_item + local
        stream = stream_of(key, item)
        nx, ny, nz = normals[item, 0], normals[item, 1], normals[item, 2]

        # Choose one of the element's triangles by area; what is left of u serves again.
        u, v = pair(stream, index, 0)
        k = first[item]
        while k + 1 < first[item + 1] and u >= share[k]:
            u -= share[k]
            k += 1
        b, c = triangle_weights(min(u / share[k], 1.0), v)
        a = 1.0 - b - c
        x = a * triangles[k, 0, 0] + b * triangles[k, 1, 0] + c * triangles[k, 2, 0] + tables.offset * nx
        y = a * triangles[k, 0, 1] + b * triangles[k, 1, 1] + c * triangles[k, 2, 1] + tables.offset * ny
        z = a * triangles[k, 0, 2] + b * triangles[k, 1, 2] + c * triangles[k, 2, 2] + tables.offset * nz

        u, v = pair(stream, index, 1)
        cast = cast_shadow_ray(
            tables, emitters, shadows, cast, x, y, z, nx, ny, nz, 1.0, 1.0, 1.0, local, u, v
        )
        leave_vertex(paths, row, x, y, z, nx, ny, nz, 1.0, 1.0, 1.0, local, 0, stream, index)
    return cast
