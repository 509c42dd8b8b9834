"""Lightmaps by virtual lights: instant radiosity with texels in place of pixels ([K 4.3])."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from solver.engine.instant.blocks import LightBlock, LightBlocks, block_paths
from solver.engine.instant.nearby import PATHS_PER_RAY, nearby_light
from solver.engine.instant.spread import Spread
from solver.engine.lightmaps.bake import Bake, LightmapRequest, LightmapSource
from solver.engine.world import World
from solver.illumination.lightmaps.texels import Texels
from solver.illumination.particles.compensation import Known
from solver.illumination.particles.receivers import Receivers
from solver.illumination.settings import Compensation, LightSettings
from solver.types import LUMINANCE_WEIGHTS, Float32Array, Int64Array

_PART: Final = 1 << 16
"""Texels lit between two yields."""


class LightsBake(Bake):
    """Adds blocks of lights, each a complete estimate, until they agree."""

    source = LightmapSource.VPL

    def __init__(
        self,
        world: World,
        revision: int,
        request: LightmapRequest,
        settings: LightSettings,
        known: Known | None,
    ) -> None:
        """`known`: the light of a solution, if it is to be used where short rays end."""
        super().__init__(world, revision, request)
        self._settings = settings
        self._known = known
        self._bound = settings.vpl_bound
        self._parts: list[Float32Array] = []
        self._paths = 0
        self._spread = Spread()
        self._turn = 0

    @property
    def is_drawable(self) -> bool:
        """Once there is one block."""
        return self._paths > 0

    @property
    def progress(self) -> float:
        """The variance that is to be reached over the present one, or the share of the paths allowed."""
        settings = self._settings
        variance = (settings.error_tolerance / max(self._spread.estimate, settings.error_tolerance)) ** 2
        return 1.0 if self.is_over else max(variance, min(1.0, self._paths / settings.max_paths))

    @property
    def error_estimate(self) -> float:
        """By how the blocks differ."""
        return self._spread.estimate

    @property
    def converged(self) -> bool:
        """Whether the error is within the tolerance."""
        return self._spread.estimate <= self._settings.error_tolerance

    @property
    def method(self) -> str:
        """Paths that lights were left by."""
        return f"{self._paths} paths"

    def _irradiance(self) -> Float32Array:
        return np.concatenate([part.T for part in self._parts] or [np.zeros((0, 3), dtype=np.float32)])

    def _light(self, texels: Texels) -> Iterator[None]:
        blocks = LightBlocks(self._world, self._settings.vpl_resolution)
        receivers = [
            Receivers.on(blocks.polygons, texels.position[part], texels.patch[part])
            for part in _slices(len(texels), _PART)
        ]
        self._parts = [np.zeros((3, len(part)), dtype=np.float32) for part in receivers]
        number = 0
        while not (self.converged or self._paths >= self._settings.max_paths):
            block = blocks.block(number)
            yield
            light = [np.zeros_like(part) for part in self._parts]
            yield from self._shine(blocks, block, receivers, light)
            if self._settings.vpl_compensation is not Compensation.NONE and np.isfinite(self._bound):
                yield from self._compensate(blocks, block, texels, light)
            self._add(light, block_paths(number))
            number += 1
            yield

    def _shine(
        self, blocks: LightBlocks, block: LightBlock, receivers: list[Receivers], light: list[Float32Array]
    ) -> Iterator[None]:
        for batch in range(len(block.sights)):
            blocks.sights(block, batch)
            yield
            for lit, here in zip(light, receivers, strict=True):
                blocks.shine(lit, here, block, batch, self._bound)
                yield

    def _compensate(
        self, blocks: LightBlocks, block: LightBlock, texels: Texels, light: list[Float32Array]
    ) -> Iterator[None]:
        """Add what bounded lights leave out: a ray for every `PATHS_PER_RAY` paths, over the texels."""
        near = nearby_light(blocks, block, self._bound, self._bound, self._known)
        rays, every = max(1, block.paths // PATHS_PER_RAY), max(1, PATHS_PER_RAY // block.paths)
        for ray in range(rays):
            turn = self._turn + ray
            for lit, part in zip(light, _slices(len(texels), _PART), strict=True):
                stream: Int64Array = texels.pixel[part].astype(np.int64)
                asked = np.flatnonzero((stream + self._turn) % every == 0)
                at, patch = texels.position[part][asked], texels.patch[part][asked]
                lit[:, asked] += np.float32(every / rays) * near.at(at, patch, stream[asked], turn)
                yield
        self._turn += rays

    def _add(self, light: list[Float32Array], paths: int) -> None:
        """Take a block into the mean, and learn from how it differs from those before."""
        after = self._paths + paths
        square = apart = 0.0
        for mean, fresh in zip(self._parts, light, strict=True):
            fresh -= mean
            if self._paths > 0:
                apart += float(np.sum((LUMINANCE_WEIGHTS @ fresh) ** 2))
            mean += np.float32(paths / after) * fresh
            square += float(np.sum((LUMINANCE_WEIGHTS @ mean) ** 2))
        if self._paths > 0:
            self._spread.learn(self._paths, paths, apart, square)
        self._paths = after


def _slices(count: int, part: int) -> list[slice]:
    return [slice(first, min(count, first + part)) for first in range(0, count, part)]
