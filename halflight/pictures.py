"""What `halflight render` works on until its picture is good enough: the radiosity solution, or paths."""

from __future__ import annotations

import time
from typing import Final, Protocol

from solver.document.limits import SceneLimits
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.instant.frames import InstantFrames
from solver.engine.requests import FrameRequest, RendererName
from solver.engine.views import InstantView
from solver.engine.world import World
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from solver.pathtracing import PathTracer
from solver.types import AnyArray

SAMPLES_PER_PASS: Final = 4
"""Path samples of a pixel that are stratified together."""

_UNLIMITED: Final = SceneLimits(max_polygons=2**31, max_vertices=2**31)


class Picture(Protocol):
    """A picture in the making."""

    @property
    def progress(self) -> float:
        """0 to 1"""

    @property
    def error_estimate(self) -> float:
        """Estimated relative error; infinite while nothing is known of it."""

    @property
    def converged(self) -> bool:
        """Whether it is as good as was asked for."""

    @property
    def summary(self) -> str:
        """What it consists of, in a few words."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know about it."""

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; True while more work remains."""

    def draw(self) -> AnyArray:
        """The picture, (height, width, ...), not yet encoded."""


class RadiosityPicture:
    """A frame of the radiosity solution, drawn once it is within the tolerance and all in view is built."""

    def __init__(self, scene: Scene, request: FrameRequest, tolerance: float, drawing: Drawing) -> None:
        """Raises SceneError, NotAvailableError, RenderingUnavailableError where it could not be drawn."""
        self._engine = Engine(scene, LightSettings(error_tolerance=tolerance), _UNLIMITED, drawing)
        self._request = request
        self._engine.outlook(request)

    @property
    def progress(self) -> float:
        """Of the solve; what is built on it is done in little time."""
        return self._engine.status().progress

    @property
    def error_estimate(self) -> float:
        """Of the frame."""
        return self._engine.outlook(self._request).error_estimate

    @property
    def converged(self) -> bool:
        """Whether it has reached its tolerance, and is complete."""
        return self._engine.outlook(self._request).converged

    @property
    def summary(self) -> str:
        """Elements, links, and what is built on them."""
        status = self._engine.status()
        told = f"{status.statistics.elements:,} elements, {status.statistics.links:,} links"
        return f"{told}, {status.fine.interpolants:,} interpolants" if status.fine.interpolants else told

    @property
    def warnings(self) -> tuple[str, ...]:
        """Of the scene and the solve."""
        return self._engine.status().warnings

    def step(self, budget: float) -> bool:
        """Work on."""
        self._engine.step(budget)
        return self._engine.outlook(self._request).improving

    def draw(self) -> AnyArray:
        """The frame."""
        return self._engine.frame(self._request).image


class InstantPicture:
    """A frame by virtual point lights, without any solution, lit until it is within the tolerance."""

    def __init__(self, scene: Scene, request: FrameRequest, tolerance: float, drawing: Drawing) -> None:
        """Raises SceneError, NotAvailableError, LimitExceededError, RenderingUnavailableError."""
        drawing.require(RendererName.VPL, request.layer)
        world = World.of(scene)
        frames = InstantFrames(world, LightSettings(error_tolerance=tolerance), _no_solution)
        camera = request.camera.resolve(scene)
        self._frame = frames.ask(camera, request.samples, tolerance, drawing)
        self._view = InstantView(self._frame, world, request.layer, tolerance)
        self._tolerance = tolerance
        self.warnings = world.surfaces.warnings
        """Of the scene."""

    @property
    def progress(self) -> float:
        """The variance that was to be reached over the present one, about."""
        return (self._tolerance / max(self.error_estimate, self._tolerance)) ** 2

    @property
    def error_estimate(self) -> float:
        """Of reflected light."""
        return self._view.error_estimate

    @property
    def converged(self) -> bool:
        """Whether that is within the tolerance."""
        return self._view.converged

    @property
    def summary(self) -> str:
        """Paths whose light is in it."""
        return f"{self._frame.frame.paths:,} paths"

    def step(self, budget: float) -> bool:
        """Light it on."""
        start = time.perf_counter()
        while self._view.improving and time.perf_counter() - start < budget:
            self._frame.frame.step()
        return self._view.improving

    def draw(self) -> AnyArray:
        """The frame."""
        return self._view.draw()


def _no_solution() -> None:
    """There is none."""


class PathPicture:
    """A path-traced frame, traced until its noise is within the tolerance, or for a number of samples."""

    def __init__(self, scene: Scene, request: FrameRequest, tolerance: float, samples: int | None) -> None:
        """With at least `samples` a pixel, whatever the noise; otherwise until it is within `tolerance`."""
        world = World.of(scene)
        passes = None if samples is None else -(-samples // SAMPLES_PER_PASS)
        tracer = PathTracer(world.surfaces, world.rays)
        self._frame = tracer.frame(request.camera.resolve(scene), SAMPLES_PER_PASS, passes)
        self._tolerance = tolerance
        self._samples = samples
        self._error, self._error_passes = float("inf"), 0
        self.warnings = world.surfaces.warnings
        """Of the scene."""

    @property
    def progress(self) -> float:
        """Samples of those asked for; or the variance that was to be reached over the present one."""
        if self._samples is not None:
            return min(1.0, self._frame.samples / self._samples)
        return (self._tolerance / max(self.error_estimate, self._tolerance)) ** 2

    @property
    def error_estimate(self) -> float:
        """Relative noise of the frame."""
        if self._error_passes != self._frame.passes:
            self._error, self._error_passes = self._frame.error_estimate, self._frame.passes
        return self._error

    @property
    def converged(self) -> bool:
        """Whether the samples are taken, or the noise is within the tolerance."""
        if self._samples is not None:
            return self._frame.samples >= self._samples
        return self.error_estimate <= self._tolerance

    @property
    def summary(self) -> str:
        """Samples of a pixel, and rays."""
        return f"{self._frame.samples} samples a pixel, {self._frame.ray_count:,} rays"

    def step(self, budget: float) -> bool:
        """Trace on."""
        self._frame.step(budget)
        return not self.converged

    def draw(self) -> AnyArray:
        """Radiance."""
        return self._frame.radiance.astype("f4")
