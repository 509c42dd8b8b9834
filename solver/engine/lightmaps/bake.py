"""A lightmap in the making: laid out first, then lit, whoever brings the light."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from solver.engine.world import World
from solver.illumination.lightmaps.atlas import Atlas, lay_out
from solver.illumination.lightmaps.filling import buried, fill
from solver.illumination.lightmaps.texels import Texels, texels_of
from solver.types import LUMINANCE_WEIGHTS, Float32Array

MOST_TEXELS: Final = 2**21
"""Texels of a lightmap, unless more are allowed: about 250 bytes each while it is made."""

_DARK: Final = 0.05
"""Texels with less light than this share of the mean are looked at: they may be inside of something."""


class LightmapSource(StrEnum):
    """Where the light of a lightmap comes from."""

    VPL = "vpl"
    """Virtual point lights, straight from the scene"""
    RADIOSITY = "radiosity"
    """The radiosity solution"""


class Gather(StrEnum):
    """How the light of a solution comes to texels."""

    AUTO = "auto"
    """Exactly where there are few texels, else by the solution"""
    EXACT = "exact"
    """By the exact gather at every texel"""
    SOLUTION = "solution"
    """By the solution's own linear functions: quick, with the edges of elements"""


@dataclass(frozen=True)
class LightmapRequest:
    """A lightmap."""

    density: float | None = None
    """Texels per metre; None: as suits"""
    source: LightmapSource = LightmapSource.VPL
    gather: Gather = Gather.AUTO
    """With `RADIOSITY` alone"""
    most_texels: int = MOST_TEXELS


@dataclass(frozen=True, eq=False)
class Lightmap:
    """The irradiance of a scene's surfaces."""

    revision: int
    world: World
    atlas: Atlas
    texels: Texels
    irradiance: Float32Array
    """(height, width, 3) W/m2, top row first; 0 far from all charts"""
    source: LightmapSource
    method: str
    """How the light has come to texels, in a word"""
    error_estimate: float
    """Relative RMS error of irradiance over all texels"""
    converged: bool
    """Whether all of it is there, and that within the tolerance of the settings"""


class Bake(ABC):
    """One lightmap of one revision."""

    source: LightmapSource

    def __init__(self, world: World, revision: int, request: LightmapRequest) -> None:
        self.revision = revision
        self._world = world
        self._request = request
        self._atlas: Atlas | None = None
        self._texels: Texels | None = None
        self._is_over = False
        self._work = self._run()

    @property
    def is_over(self) -> bool:
        """Whether no more can be done."""
        return self._is_over

    @property
    @abstractmethod
    def is_drawable(self) -> bool:
        """Whether every texel has an estimate of all of its light."""

    @property
    @abstractmethod
    def progress(self) -> float:
        """0 to 1"""

    @property
    @abstractmethod
    def error_estimate(self) -> float:
        """Estimated relative error of what is there; 1 while nothing is known of it."""

    @property
    @abstractmethod
    def converged(self) -> bool:
        """Whether it is as good as the settings ask."""

    @property
    @abstractmethod
    def method(self) -> str:
        """How the light comes to texels, in a word."""

    @abstractmethod
    def _light(self, texels: Texels) -> Iterator[None]:
        """Light all texels; yields every few milliseconds."""

    @abstractmethod
    def _irradiance(self) -> Float32Array:
        """(n, 3) W/m2 of all texels, as far as known."""

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; True while more work remains.

        Raises SceneError naming the density where it asks for too many texels.
        """
        start = time.perf_counter()
        while not self._is_over:
            self._is_over = next(self._work, _OVER) is _OVER
            if time.perf_counter() - start >= budget:
                break
        return not self._is_over

    def lightmap(self) -> Lightmap:
        """The lightmap as it stands, which must be drawable."""
        atlas, texels, world = self._atlas, self._texels, self._world
        assert atlas is not None and texels is not None
        light = self._irradiance()
        bright = light @ LUMINANCE_WEIGHTS
        dark = np.flatnonzero(bright <= _DARK * bright.sum() / max(1, len(bright))).astype(np.int32)
        known = np.zeros(atlas.height * atlas.width, dtype=np.bool_)
        known[texels.pixel] = True
        hidden = buried(texels.position[dark], texels.patch[dark], world.surfaces, world.rays)
        known[texels.pixel[dark[hidden]]] = False
        image = np.zeros((atlas.height * atlas.width, 3), dtype=np.float32)
        image[texels.pixel] = light
        image[~known] = 0.0
        picture = image.reshape(atlas.height, atlas.width, 3)
        fill(picture, known.reshape(atlas.height, atlas.width), texels.chart)
        return Lightmap(
            revision=self.revision,
            world=world,
            atlas=atlas,
            texels=texels,
            irradiance=picture,
            source=self.source,
            method=self.method,
            error_estimate=self.error_estimate,
            converged=self.converged,
        )

    def _run(self) -> Iterator[None]:
        surfaces, asked = self._world.surfaces, self._request
        atlas = self._atlas = yield from lay_out(surfaces, asked.density, asked.most_texels)
        yield
        texels = self._texels = texels_of(atlas, surfaces)
        yield
        yield from self._light(texels)


_OVER: Final = object()
