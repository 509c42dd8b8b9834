"""One camera's frame by virtual lights, which gets better for as long as it is given time.

Light is collected as irradiance at the points that pixels show. Of the first blocks each image is kept: when
the scene changes, the oldest is replaced by one of the new scene, one after the other ([K 4.3]), and what the
picture shows of old light fades within a few frames. Pixels whose point is another one than before have new
light only. Once all are replaced, and the scene rests, larger blocks are added until the error is small.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from solver.engine.instant.blocks import FIRST, RING, LightBlock, LightBlocks, block_paths
from solver.engine.instant.dealing import Dealer
from solver.engine.instant.image import Image, joined, mean_gloss, mean_light
from solver.engine.instant.nearby import HELPERS, PATHS_PER_RAY, nearby_light, shared_rays
from solver.engine.instant.points import GlossyPoints, LitPoints, matched
from solver.engine.instant.resolve import (
    CHUNK,
    Glow,
    add_irradiance,
    add_luminance,
    add_radiance,
    add_shared,
    add_to_pixels,
    in_pieces,
    take_in,
)
from solver.engine.instant.spread import Spread
from solver.geometry.scene import Camera
from solver.illumination.particles.compensation import Known, NearbyLight
from solver.illumination.particles.receivers import Receivers
from solver.parallel import run_chunks
from solver.rendering.surface_points import SurfacePoints
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Int64Array, IntArray

T = TypeVar("T", bound=np.generic)

PATHS_PER_LOBE: Final = 8
"""Paths of a block for each ray that a pixel sends by a narrow lobe: lamps are found by these alone."""

_LOBE_HELPERS: Final = 1
"""Batches of lights that light up what rays by lobes meet, of which there are many."""

_AT_ONCE: Final = 1 << 16
"""Rays to what is near between two yields."""


@dataclass(frozen=True)
class InstantSettings:
    """How virtual lights are used."""

    bound: float
    """Of cos cos' / r^2, with lengths in diameters of the scene; may be infinite"""
    compensates: bool
    """Whether what the bound takes away is put back"""


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
        self._known = known
        world = blocks.world
        self._points = [LitPoints.of(p, camera, world) for p in points]
        self._glossy = [GlossyPoints.of(p, world, blocks.polygons) for p in self._points]
        self._receivers = [Receivers.on(blocks.polygons, p.position, p.patch) for p in self._points]
        self._ring: list[Image | None] = [None] * RING
        self._rest: Image | None = None
        self._spread = Spread()
        self._first: Image | None = None
        self._seen: FloatArray | None = None
        self._seen_paths = 0
        self._dealt = Dealer(len(points))
        self._turn = 0
        self._lobe_turn = 0
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
        return self._spread.estimate if self.is_new else 1.0

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
        """(h, w, 3) W/m2, the mean over the samples of each pixel; 0 where nothing is seen.

        It is that of the surfaces that pixels show themselves: of a mirror, what falls on the mirror.
        """
        picture, share = self._black(), 1.0 / len(self._points)
        for points, light in zip(self._points, mean_light(self._images(), self._points), strict=True):
            add = partial(add_irradiance, pixel=points.pixel, light=light, share=share, picture=picture)
            run_chunks(add, points.shown, CHUNK)
        return self._shaped(picture)

    def radiance(self) -> FloatArray:
        """(h, w, 3) W/(m2 sr)."""
        surfaces, images = self._blocks.world.surfaces, self._images()
        glow, picture, share = Glow.of(surfaces), self._black(), 1.0 / len(self._points)
        lights, lobes = mean_light(images, self._points), mean_gloss(images, self._glossy)
        for points, glossy, light, gloss in zip(self._points, self._glossy, lights, lobes, strict=True):
            add = partial(
                add_radiance, pixel=points.pixel, patch=points.patch, position=points.position,
                eye=points.eye, shown=points.shown, arrival=points.arrival, left=points.left, glow=glow,
                light=light, share=share, picture=picture,
            )  # fmt: skip
            in_pieces(add, points.shown, len(points))
            row = glossy.row
            if len(row) > 0:
                lobed = points.weight(row) * surfaces.specular[points.patch[row]] * gloss.T
                add_to_pixels(points.pixel[row], share / np.pi * lobed, picture)
        return self._shaped(picture)

    def _black(self) -> FloatArray:
        return np.zeros((self.camera.width * self.camera.height, 3))

    def _shaped(self, picture: FloatArray) -> FloatArray:
        return picture.reshape(self.camera.height, self.camera.width, 3)

    def _images(self) -> list[Image]:
        return [image for image in (*self._ring, self._rest) if image is not None]

    # --- the work ------------------------------------------------------------------------------------

    def _run(self) -> Iterator[None]:
        number = 0
        while True:
            replaced = self._ring[number] if number < RING else None
            if replaced is None or not replaced.is_new:
                image = Image.dark(self._points, self._glossy, block_paths(number))
                yield from self._shine(image, number)
                self._judge(image)
                if number < RING:
                    self._ring[number] = image
                else:
                    self._rest = image if self._rest is None else joined(self._rest, image)
                self.version += 1
                yield
            number += 1

    def _shine(self, image: Image, number: int) -> Iterator[None]:
        """Collect the light of a block."""
        block = yield from self._blocks.block_in_steps(number)
        yield
        bound = self._settings.bound
        for batch in range(len(block.sights)):
            self._blocks.sights(block, batch)
            yield
            for sample, factor in self._dealt.deal(block, batch):
                self._blocks.shine(image.light[sample], self._receivers[sample], block, batch, bound, factor)
                glossy = self._glossy[sample]
                if len(glossy.broad) > 0:
                    light = np.zeros((3, len(glossy.broad)), dtype=np.float32)
                    self._blocks.shine(light, glossy.receivers, block, batch, bound, factor, glossy.gloss)
                    image.gloss[sample][:, glossy.broad] += light
                yield
        if self._settings.compensates and np.isfinite(bound):
            yield from self._compensate(image, block)
        if any(len(glossy.narrow) > 0 for glossy in self._glossy):
            yield from self._send_lobes(image, block)

    def _nearby(self, block: LightBlock, helpers: int, sample: int) -> NearbyLight:
        """What rays of a block come upon, by so many batches, and what its lights leave out."""
        bound = self._settings.bound
        which = (sample, len(self._points))
        reach_bound = bound if self._settings.compensates else np.inf
        return nearby_light(self._blocks, block, bound, reach_bound, self._known(), helpers, which)

    def _compensate(self, image: Image, block: LightBlock) -> Iterator[None]:
        """Add what its lights leave out, by a ray for every `PATHS_PER_RAY` paths, over all samples.

        Of blocks with fewer paths neighbours share a ray, another's each time.
        """
        rays = max(1, round(block.paths / (PATHS_PER_RAY * len(self._points))))
        every = max(1, round(PATHS_PER_RAY * len(self._points) / block.paths))
        for sample, points in enumerate(self._points):
            near = self._nearby(block, HELPERS, sample)
            for ray in range(rays):
                turn = self._turn + ray
                start, asked = shared_rays(points.patch, every, self._turn)
                for first in range(0, len(asked), _AT_ONCE):
                    part = asked[first : first + _AT_ONCE]
                    stream = self._stream(sample, part)
                    found, along = near.sample(points.position[part], points.patch[part], stream, turn)
                    # What one finds is for all that stand beside it.
                    run = start[first : first + len(part) + 1]
                    add_shared(run, found, np.float32(1.0 / rays), image.light[sample])
                    if len(self._glossy[sample].broad) > 0:
                        rows = np.arange(run[0], run[-1], dtype=np.int32)
                        found = np.repeat(found, np.diff(run), axis=1) * np.float32(1.0 / rays)
                        along = np.repeat(along, np.diff(run), axis=0)
                        self._glossy[sample].add_sampled(image.gloss[sample], rows, found, along)
                    yield
        self._turn += rays

    def _stream(self, sample: int, rows: IntArray | Int64Array) -> Int64Array:
        """Numbers (k,) of points, of which no two of a frame have the same."""
        pixels = self.camera.width * self.camera.height
        return self._points[sample].keys(pixels, rows) * len(self._points) + sample

    def _send_lobes(self, image: Image, block: LightBlock) -> Iterator[None]:
        """Find the light of narrow lobes, by one ray for every `PATHS_PER_LOBE` paths, over all samples."""
        rays = max(1, round(block.paths / (PATHS_PER_LOBE * len(self._points))))
        for sample, points in enumerate(self._points):
            glossy, near = self._glossy[sample], self._nearby(block, _LOBE_HELPERS, sample)
            if near.glossy is None:
                return
            for ray in range(rays):
                for first in range(0, len(glossy.narrow), _AT_ONCE):
                    part = glossy.narrow[first : first + _AT_ONCE]
                    row = glossy.row[part]
                    found = near.glossy.by_rays(
                        near, points.position[row], points.patch[row], glossy.axis[part],
                        self._stream(sample, row), self._lobe_turn + ray,
                    )  # fmt: skip
                    image.gloss[sample][:, part] += found / rays
                    yield
        self._lobe_turn += rays

    def _judge(self, fresh: Image) -> None:
        """Learn from how a new image differs from those before."""
        if self._first is None:
            self._first = fresh
            return
        if self._seen is None:
            # Frames of cameras that move have one image.
            self._seen, self._seen_paths = self._reflected(self._first), self._first.paths
        apart, power = take_in(self._seen, self._seen_paths, self._reflected(fresh), fresh.paths)
        self._spread.learn(self._seen_paths, fresh.paths, apart, power)
        self._seen_paths += fresh.paths

    def _reflected(self, image: Image) -> FloatArray:
        """Luminance (h w,) of what pixels reflect."""
        surfaces = self._blocks.world.surfaces
        matt, shiny = surfaces.reflectance * LUMINANCE_WEIGHTS, surfaces.specular * LUMINANCE_WEIGHTS
        seen = np.zeros(self.camera.width * self.camera.height)
        for points, glossy, light, lobes in zip(
            self._points, self._glossy, image.light, image.gloss, strict=True
        ):
            add = partial(
                add_luminance, pixel=points.pixel, patch=points.patch, shown=points.shown, left=points.left,
                matt=matt, light=light, seen=seen,
            )  # fmt: skip
            in_pieces(add, points.shown, len(points))
            row = glossy.row
            if len(row) > 0:
                value = np.einsum("nc,cn->n", points.weight(row) * shiny[points.patch[row]], lobes)
                np.add.at(seen, points.pixel[row], value)
        return seen

    def _take_over(self, before: InstantFrame) -> None:
        """Let the mean of `before` stand in for all images that are not there yet."""
        images = before._images()
        if not images:
            return
        light, gloss, valid = [], [], []
        means, lobes = mean_light(images, before._points), mean_gloss(images, before._glossy)
        pixels = self.camera.width * self.camera.height
        for sample, mine in enumerate(self._points):
            theirs, lobed = before._points[sample], self._glossy[sample].row
            source, same = matched(mine, theirs, self._blocks.world, before._blocks.world, pixels)
            known = np.logical_or.reduce([image.valid[sample] for image in images])
            same &= _picked(known[None], source)[0]
            mirrored, same = before._glossy[sample].matched(self._glossy[sample], source, same)
            light.append(np.where(same, _picked(means[sample], source), np.float32(0.0)))
            gloss.append(np.where(same[lobed], _picked(lobes[sample], mirrored), np.float32(0.0)))
            valid.append(same)
        self._ring = [Image(light, gloss, valid, False, FIRST) for _ in range(RING)]


def _picked(values: NDArray[T], index: Int64Array) -> NDArray[T]:
    """Columns of values (c, n); 0 where there are none."""
    if values.shape[1] == 0:
        return np.zeros((len(values), len(index)), dtype=values.dtype)
    return values[:, index]
