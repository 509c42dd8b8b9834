"""One camera's frame by virtual lights, which gets better for as long as it is given time.

Light is collected as irradiance at the points that pixels show. Of the first blocks each image is kept: when
the scene changes, the oldest is replaced by one of the new scene, one after the other ([K 4.3]), and what the
picture shows of old light fades within a few frames. Pixels whose point is another one than before have new
light only. Once all are replaced, and the scene rests, larger blocks are added until the error is small.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.engine.instant.blocks import FIRST, RING, LightBlock, LightBlocks, block_paths
from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.compensation import Known, NearbyLight
from solver.illumination.particles.lighting import add_light
from solver.illumination.particles.receivers import Receivers
from solver.rendering.surface_points import SurfacePoints
from solver.types import LUMINANCE_WEIGHTS, BoolArray, Float32Array, FloatArray

PATHS_PER_RAY: Final = 32
"""Paths of a block for each ray that a pixel sends to what is near."""

_HELPERS: Final = 4
"""Batches of lights that light up what such rays meet."""

_AT_ONCE: Final = 1 << 15
"""Rays to what is near between two yields."""

_SAME: Final = 1e-9
"""Points nearer than this times the scene's size are the same."""


@dataclass(frozen=True)
class InstantSettings:
    """How virtual lights are used."""

    bound: float
    """Of cos cos' / r^2, with lengths in diameters of the scene; may be infinite"""
    compensates: bool
    """Whether what the bound takes away is put back"""


@dataclass(eq=False)
class _Image:
    """Irradiance W/m2 at the points of a frame, by one block or by several."""

    light: list[Float32Array]
    """(3, n) of the points of each sample"""
    valid: list[BoolArray]
    """(n,) of each sample"""
    is_new: bool
    """Whether it is of the scene as it stands"""
    paths: int

    @classmethod
    def dark(cls, points: list[SurfacePoints], paths: int) -> _Image:
        """No light, which is known everywhere."""
        return cls(
            [np.zeros((3, len(p)), dtype=np.float32) for p in points],
            [np.ones(len(p), dtype=np.bool_) for p in points],
            True,
            paths,
        )


class InstantFrame:
    """A frame in the making. `points` holds the points of each sample of a pixel, in lists of their own."""

    def __init__(
        self,
        blocks: LightBlocks,
        settings: InstantSettings,
        camera: Camera,
        points: list[SurfacePoints],
        known: Callable[[], Known | None],
        before: InstantFrame | None = None,
    ) -> None:
        """Take over from `before`, a frame of the same camera and samples, what has stayed where it was.

        `known` gives the light of a solution where there is one that may be used.
        """
        self.camera = camera
        self.version = 0
        """Counts the changes of the picture."""
        self._blocks = blocks
        self._settings = settings
        self._points = points
        self._known = known
        self._receivers = [Receivers.on(blocks.polygons, p.position, p.patch) for p in points]
        self._stream = [p.pixel.astype(np.int64) * len(points) + k for k, p in enumerate(points)]
        self._ring: list[_Image | None] = [None] * RING
        self._rest: _Image | None = None
        self._spread = 0.0
        self._judged = 0
        self._estimate = 1.0
        self._turn = 0
        if before is not None:
            self._take_over(before)
        self._work = self._run()

    @property
    def is_drawable(self) -> bool:
        """Whether there is light of the scene as it stands."""
        return any(image is not None and image.is_new for image in self._ring)

    @property
    def is_new(self) -> bool:
        """Whether all of it is."""
        return all(image is not None and image.is_new for image in self._ring)

    @property
    def error_estimate(self) -> float:
        """Relative RMS error of reflected light; 1 while nothing is known of it."""
        return self._estimate if self.is_new else 1.0

    @property
    def paths(self) -> int:
        """Paths of the scene as it stands that have been added up."""
        return sum(image.paths for image in self._images() if image.is_new)

    @property
    def point_count(self) -> int:
        """Points that are lit."""
        return sum(len(points) for points in self._points)

    def step(self) -> None:
        """Work for some milliseconds."""
        next(self._work)

    # --- the picture ---------------------------------------------------------------------------------

    def irradiance(self) -> FloatArray:
        """(h, w, 3) W/m2, the mean over the samples of each pixel; 0 where nothing is seen."""
        return self._gathered([light.T.astype(np.float64) for light in self._mean(self._images())])

    def radiance(self) -> FloatArray:
        """(h, w, 3) W/(m2 sr)."""
        surfaces = self._blocks.world.surfaces
        seen = zip(self._points, self._mean(self._images()), strict=True)
        return self._gathered(
            [
                _emitted(surfaces, self.camera, points) + surfaces.reflectance[points.patch] * light.T / np.pi
                for points, light in seen
            ]
        )

    def _gathered(self, values: list[FloatArray]) -> FloatArray:
        width, height = self.camera.width, self.camera.height
        pixel = np.concatenate([points.pixel for points in self._points])
        joined = np.concatenate(values)
        image = [np.bincount(pixel, joined[:, c], width * height) for c in range(3)]
        return np.stack(image, axis=1).reshape(height, width, 3) / len(self._points)

    def _images(self) -> list[_Image]:
        return [image for image in (*self._ring, self._rest) if image is not None]

    def _mean(self, images: list[_Image]) -> list[Float32Array]:
        """Irradiance (3, n) of each sample, of each image by its paths where it is valid."""
        means = []
        for sample, points in enumerate(self._points):
            total = np.zeros((3, len(points)), dtype=np.float32)
            weight = np.zeros(len(points), dtype=np.float32)
            for image in images:
                share = np.float32(image.paths) * image.valid[sample]
                total += share * image.light[sample]
                weight += share
            means.append(np.asarray(total / np.maximum(weight, 1.0), dtype=np.float32))
        return means

    # --- the work ------------------------------------------------------------------------------------

    def _run(self) -> Iterator[None]:
        number = 0
        while True:
            replaced = self._ring[number] if number < RING else None
            if replaced is None or not replaced.is_new:
                image = _Image.dark(self._points, block_paths(number))
                yield from self._shine(image, number)
                self._judge(image)
                if number < RING:
                    self._ring[number] = image
                else:
                    self._rest = image if self._rest is None else _joined(self._rest, image)
                self.version += 1
                yield
            number += 1

    def _shine(self, image: _Image, number: int) -> Iterator[None]:
        """Collect the light of a block."""
        samples = len(self._points)
        block = self._blocks.block(number)
        yield
        for batch in range(len(block.sights)):
            sights = self._blocks.sights(block, batch)
            yield
            # Each sample has its share of the batches, as much stronger: a pixel has all.
            sample = (batch + number) % samples
            lights = block.batch(batch, samples)
            add_light(image.light[sample], self._receivers[sample], lights, sights, self._settings.bound)
            yield
        if self._settings.compensates and np.isfinite(self._settings.bound):
            yield from self._compensate(image, block)

    def _compensate(self, image: _Image, block: LightBlock) -> Iterator[None]:
        """Add what its lights leave out, by a ray for every `PATHS_PER_RAY` paths, over all samples."""
        world, bound = self._blocks.world, self._settings.bound
        helper = self._blocks.kept(block)

        batches = len(helper.sights)

        def shine(receivers: Receivers, turn: int) -> Float32Array:
            # Other lights each time, so that in the mean all of them shine there.
            light = np.zeros((3, len(receivers)), dtype=np.float32)
            for k in range(min(_HELPERS, batches)):
                batch = (turn * _HELPERS + k) % batches
                lights = helper.batch(batch, max(1.0, batches / _HELPERS))
                add_light(light, receivers, lights, self._blocks.sights(helper, batch), bound)
            return light

        near = NearbyLight(world.surfaces, self._blocks.polygons, world.rays, bound, shine, self._known())
        rays = max(1, round(block.paths / (PATHS_PER_RAY * len(self._points))))
        every = max(1, round(PATHS_PER_RAY * len(self._points) / block.paths))
        for sample, points in enumerate(self._points):
            for ray in range(rays):
                turn = self._turn + ray
                asked = np.flatnonzero((self._stream[sample] + self._turn) % every == 0).astype(np.int32)
                for first in range(0, len(asked), _AT_ONCE):
                    part = asked[first : first + _AT_ONCE]
                    stream = self._stream[sample][part]
                    found = near.at(points.position[part], points.patch[part], stream, turn)
                    image.light[sample][:, part] += np.float32(every / rays) * found
                    yield
        self._turn += rays

    def _judge(self, fresh: _Image) -> None:
        """Learn from how a new image differs from those before."""
        images = [image for image in self._images() if image.is_new]
        if not images:
            return
        before = sum(image.paths for image in images)
        known, new = self._reflected(self._mean(images)), self._reflected(fresh.light)
        after = before + fresh.paths
        apart = float(np.mean((known - new) ** 2)) * before * fresh.paths / after
        self._spread += fresh.paths * apart
        self._judged += fresh.paths
        mean = (before * known + fresh.paths * new) / after
        power = float(np.mean(mean**2))
        squared = self._spread / self._judged / after
        self._estimate = min(1.0, float(np.sqrt(squared / power))) if power > 0.0 else 0.0

    def _reflected(self, light: list[Float32Array]) -> FloatArray:
        """Luminance (h w,) of what pixels reflect."""
        weights = self._blocks.world.surfaces.reflectance * LUMINANCE_WEIGHTS
        seen = zip(self._points, light, strict=True)
        values = np.concatenate([np.einsum("nc,cn->n", weights[p.patch], part) for p, part in seen])
        pixel = np.concatenate([points.pixel for points in self._points])
        return np.asarray(np.bincount(pixel, values, self.camera.width * self.camera.height), np.float64)

    def _take_over(self, before: InstantFrame) -> None:
        """Let the mean of `before` stand in for all images that are not there yet."""
        images = before._images()
        if not images:
            return
        light, valid = [], []
        size = self._blocks.world.surfaces.size
        for sample, (mine, mean) in enumerate(zip(self._points, before._mean(images), strict=True)):
            theirs = before._points[sample]
            at = np.full(self.camera.width * self.camera.height, -1, dtype=np.int32)
            at[theirs.pixel] = np.arange(len(theirs), dtype=np.int32)
            source = at[mine.pixel]
            same = source >= 0
            normal = self._blocks.world.surfaces.normal[mine.patch]
            other = before._blocks.world.surfaces.normal[theirs.patch[source]]
            apart = np.abs(mine.position - theirs.position[source]).max(axis=1)
            same &= (apart <= _SAME * size) & (np.abs(normal - other).max(axis=1) <= _SAME)
            known = np.logical_or.reduce([image.valid[sample] for image in images])
            same &= known[source]
            light.append(np.where(same, mean[:, source], np.float32(0.0)))
            valid.append(same)
        self._ring = [_Image(light, valid, False, FIRST) for _ in range(RING)]


def _joined(a: _Image, b: _Image) -> _Image:
    """Two images, valid everywhere, as one."""
    paths = a.paths + b.paths
    share = np.float32(b.paths / paths)
    light = [x + share * (y - x) for x, y in zip(a.light, b.light, strict=True)]
    return _Image(light, a.valid, True, paths)


def _emitted(surfaces: Surfaces, camera: Camera, points: SurfacePoints) -> FloatArray:
    """Radiance (n, 3) W/(m2 sr) that points emit towards the camera."""
    exponent = surfaces.emission_exponent[points.patch]
    radiance = surfaces.emission[points.patch] / np.pi
    if exponent.any():
        towards = camera.eye - points.position
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        cosine = np.maximum(np.einsum("na,na->n", towards, surfaces.normal[points.patch]), 0.0)
        radiance = radiance * (0.5 * (exponent + 2.0) * cosine**exponent)[:, None]
    return np.asarray(radiance)
