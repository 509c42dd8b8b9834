"""What frames are told against: luminances of some pixels of a view, path-traced twice.

Of every block of 5 by 5 pixels one is chosen at random, and kept if it and all around it show one patch of
something that does not emit. Fewer pixels that are known better tell a small error sooner than many that are
known worse. With y what a frame shows, and u, v two independent unbiased estimates of what is right,

    E[sum (y - u)(y - v)] = sum (y - truth)^2    and    E[sum u v] = sum truth^2,

so that the estimates' own noise is not in the error. `python -m benchmarks.report.truth SCENE` makes a file
anew, by the project's path tracer, which shares nothing with what it judges but the geometry; tests hold it
against frames that the project did not compute.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np

from benchmarks.report.views import CAMERA
from solver.document.samples import load_sample
from solver.engine.world import World
from solver.geometry.scene import Camera, Scene
from solver.pathtracing import PathTracer
from solver.types import LUMINANCE_WEIGHTS, AnyArray, FloatArray, Int64Array, IntArray, Points

BLOCK: Final = 5
"""Pixels along a side of a block, of which one is compared"""

GRID: Final = 4
"""Samples along a side of a pixel"""

PATHS: Final = 4096
"""Of a pixel, for each of its two estimates"""

_DIRECTORY: Final = Path(__file__).parent / "truths"
_POINTS_AT_ONCE: Final = 1 << 16


@dataclass(frozen=True, eq=False)
class Truth:
    """Pixels of one view, and two estimates of what each of them shows."""

    width: int
    height: int
    pixels: Int64Array
    """(n,) row * width + column"""
    first: FloatArray
    """(n,) luminance of radiance, W/(m2 sr)"""
    second: FloatArray

    @classmethod
    def of(cls, scene: str) -> Self:
        """The one that is kept of a sample scene. Raises OSError where there is none."""
        with np.load(_DIRECTORY / f"{scene}.npz") as file:
            return cls(
                width=int(file["width"]),
                height=int(file["height"]),
                pixels=file["pixels"].astype(np.int64),
                first=file["first"].astype(np.float64),
                second=file["second"].astype(np.float64),
            )

    def save(self, scene: str) -> None:
        """Keep it. Half floats round by less than a hundredth of the noise."""
        np.savez_compressed(
            _DIRECTORY / f"{scene}.npz",
            width=self.width,
            height=self.height,
            pixels=self.pixels.astype(np.int32),
            first=self.first.astype(np.float16),
            second=self.second.astype(np.float16),
        )

    def error(self, image: AnyArray) -> float:
        """Relative RMS luminance error of a frame, radiance (height, width, 3); 0 if noise hides it."""
        shown = image.reshape(-1, 3)[self.pixels] @ LUMINANCE_WEIGHTS
        squared = np.sum((shown - self.first) * (shown - self.second)) / np.sum(self.first * self.second)
        return float(np.sqrt(max(0.0, squared)))

    @property
    def floor(self) -> float:
        """Errors below it are not told from none: the root of two standard errors of the squared error."""
        off = 0.5 * np.var(self.first - self.second) / np.mean(self.first * self.second)
        return float(np.sqrt(2.0 * off / np.sqrt(len(self.pixels))))


@dataclass(frozen=True, eq=False)
class Footprints:
    """What pixels show: of each, GRID x GRID points of one patch."""

    pixels: Int64Array
    """(n,)"""
    positions: Points
    """(n, GRID * GRID, 3)"""
    patch: IntArray
    """(n,)"""


def footprints(world: World, camera: Camera, pixels: Int64Array) -> Footprints:
    """Of those of `pixels` that show, with what is a sample around them, one patch that does not emit."""
    offsets = (np.arange(-1, GRID + 1) + 0.5) / GRID
    column = (pixels % camera.width)[:, None, None] + offsets[None, None, :]
    row = (pixels // camera.width)[:, None, None] + offsets[None, :, None]
    origins, directions = _rays(camera, *np.broadcast_arrays(column, row))
    hits = world.rays.intersect(origins, directions)
    surfaces = world.surfaces
    sides = surfaces.triangle_patch[np.maximum(hits.triangle, 0)]
    # The first is the one that is seen from the front, if there is any: else the other.
    is_front = (
        np.einsum("ij,ij->i", _normals(surfaces.triangles[np.maximum(hits.triangle, 0)]), directions) < 0
    )
    patch = np.where(hits.triangle >= 0, np.where(is_front, sides[:, 0], sides[:, 1]), -1)
    seen = patch.reshape(len(pixels), -1)
    is_one = (seen == seen[:, :1]).all(axis=1) & (seen[:, 0] >= 0)
    is_one &= ~surfaces.emission[np.maximum(seen[:, 0], 0)].any(axis=1)
    positions = (origins + hits.distance[:, None] * directions).reshape(len(pixels), GRID + 2, GRID + 2, 3)
    own = positions[is_one, 1:-1, 1:-1].reshape(-1, GRID * GRID, 3)
    shown = seen[is_one, 0]
    # Rays have the digits of float32 only.
    normal = surfaces.normal[shown][:, None]
    height = np.einsum("ijk,ijk->ij", own - surfaces.corners[shown, :1], np.broadcast_to(normal, own.shape))
    return Footprints(pixels[is_one], own - height[:, :, None] * normal, shown.astype(np.int32))


def chosen_pixels(camera: Camera, seed: int) -> Int64Array:
    """One pixel of each block, (n,)."""
    rows, columns = camera.height // BLOCK, camera.width // BLOCK
    random = np.random.default_rng(seed)
    row = BLOCK * np.arange(rows)[:, None] + random.integers(0, BLOCK, (rows, columns))
    column = BLOCK * np.arange(columns)[None, :] + random.integers(0, BLOCK, (rows, columns))
    return np.asarray((row * camera.width + column).ravel(), dtype=np.int64)


def traced(world: World, shown: Footprints, paths: int, seed: int) -> FloatArray:
    """Radiance (n, 3) of what pixels show, W/(m2 sr), from at least `paths` paths each."""
    surfaces = world.surfaces
    tracer = PathTracer(surfaces, world.rays, seed)
    each = max(1, paths // GRID**2)
    normal = np.repeat(surfaces.normal[shown.patch], GRID**2, axis=0)
    positions = shown.positions.reshape(-1, 3)
    found = [
        tracer.irradiance(
            positions[start : start + _POINTS_AT_ONCE], normal[start : start + _POINTS_AT_ONCE], each
        )[0]
        for start in range(0, len(positions), _POINTS_AT_ONCE)
    ]
    irradiance = np.concatenate(found).reshape(-1, GRID**2, 3).mean(axis=1)
    return np.asarray(irradiance * surfaces.reflectance[shown.patch] / np.pi)


def made(scene: Scene, paths: int) -> Truth:
    """The truth of a scene by the report's camera, from twice so many paths of a pixel."""
    world, camera = World.of(scene), CAMERA.resolve(scene)
    shown = footprints(world, camera, chosen_pixels(camera, 1))
    first, second = (traced(world, shown, paths, seed) @ LUMINANCE_WEIGHTS for seed in (11, 12))
    return Truth(camera.width, camera.height, shown.pixels, first, second)


def _rays(camera: Camera, column: FloatArray, row: FloatArray) -> tuple[Points, FloatArray]:
    """Origins and directions (n, 3) through places of the picture, in pixels from its top left corner."""
    right, up, forward = camera.basis()
    tangent = np.tan(np.radians(camera.vertical_fov) / 2.0)
    across = (2.0 * column.ravel() / camera.width - 1.0) * tangent * camera.width / camera.height
    down = (1.0 - 2.0 * row.ravel() / camera.height) * tangent
    directions = forward + across[:, None] * right + down[:, None] * up
    return np.tile(camera.eye, (len(directions), 1)), directions


def _normals(triangles: FloatArray) -> FloatArray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


if __name__ == "__main__":
    for name in sys.argv[1:]:
        told = made(load_sample(name), PATHS)
        told.save(name)
        print(f"{name}: {len(told.pixels):,} pixels, errors from {told.floor:.2%} on")
