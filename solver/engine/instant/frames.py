"""The frames by virtual lights of a session: one for each camera that was asked for lately."""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Final

import numpy as np

from solver.engine.cameras import camera_key
from solver.engine.drawing import Drawing
from solver.engine.instant.blocks import LightBlocks
from solver.engine.instant.frame import InstantFrame, InstantSettings
from solver.engine.world import World
from solver.errors import LimitExceededError
from solver.geometry.scene import Camera
from solver.illumination.particles.compensation import Known
from solver.illumination.particles.patterns import Pattern, pattern_points
from solver.illumination.settings import Compensation, LightSettings
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.transport.field import RadiosityField
from solver.types import FloatArray

KEPT: Final = 4
"""Frames kept at once; a new camera takes the place of the one asked for longest ago."""

MOST_POINTS: Final = 2**23
"""Points of all frames kept, about 200 bytes each, unless a single frame has more."""

MOST_SAMPLES: Final = 16
"""Of a pixel: all of them are kept."""

INTEREST: Final = 10.0
"""Seconds for which a frame is worked on after it was last asked for."""


class AskedInstant:
    """A frame that somebody asked for."""

    def __init__(self, frame: InstantFrame, max_paths: int) -> None:
        self.frame = frame
        self.max_error = math.inf
        """Error of which somebody needs the frame"""
        self.wanted_until = 0.0
        self._max_paths = max_paths

    def is_done(self, tolerance: float) -> bool:
        """Whether it is as good as asked and within `tolerance`, or has all paths that it may have."""
        frame = self.frame
        good = frame.is_new and frame.error_estimate <= min(tolerance, self.max_error)
        return good or (frame.is_new and frame.paths >= self._max_paths)

    def needs_work(self, tolerance: float) -> bool:
        """Whether the frame is wanted, and not done."""
        return self.wanted_until > time.monotonic() and not self.is_done(tolerance)


class InstantFrames:
    """The frames of one scene, which may change."""

    def __init__(self, world: World, settings: LightSettings, known: Callable[[], Known | None]) -> None:
        """`known` gives the light of a solution where there is one."""
        self._known = known
        self._asked: OrderedDict[tuple[float, ...], AskedInstant] = OrderedDict()
        self._before: dict[tuple[float, ...], InstantFrame] = {}
        self._settings = settings
        self._begin(world)

    def follow(self, world: World) -> None:
        """Go on with another scene: its frames begin with what the present ones have in common with them."""
        self._before |= {key: asked.frame for key, asked in self._asked.items()}
        while len(self._before) > KEPT:
            self._before.pop(next(iter(self._before)))
        self._asked.clear()
        self._begin(world, self._blocks)

    def ask(self, camera: Camera, samples: int, max_error: float, drawing: Drawing) -> AskedInstant:
        """The frame of `camera` as it stands. It is wanted from now on, with at most that error.

        Raises LimitExceededError for more samples than are kept, RenderingUnavailableError.
        """
        if samples > MOST_SAMPLES:
            raise LimitExceededError("samples", samples, MOST_SAMPLES)
        key = (*camera_key(camera), samples)
        asked = self._asked.get(key)
        if asked is None:
            frame = self._new(camera, samples, drawing, self._before.pop(key, None))
            asked = self._asked[key] = AskedInstant(frame, self._settings.max_paths)
        self._asked.move_to_end(key)
        while len(self._asked) > 1 and (len(self._asked) > KEPT or self._points() > MOST_POINTS):
            self._asked.popitem(last=False)
        asked.max_error = min(asked.max_error, max_error)
        asked.wanted_until = time.monotonic() + INTEREST
        return asked

    def step(self, budget: float, tolerance: float) -> bool:
        """Work for about `budget` seconds on the frame asked for last; False if none needs work."""
        start = time.perf_counter()
        worked = False
        for asked in reversed(self._asked.values()):
            while asked.needs_work(tolerance):
                asked.frame.step()
                worked = True
                if time.perf_counter() - start >= budget:
                    return True
        return worked

    def _begin(self, world: World, before: LightBlocks | None = None) -> None:
        self._blocks = LightBlocks(world, self._settings.vpl_resolution, before=before)
        self._mesh: RenderMesh | None = None

    def _points(self) -> int:
        return sum(asked.frame.point_count for asked in self._asked.values())

    def _new(
        self, camera: Camera, samples: int, drawing: Drawing, before: InstantFrame | None
    ) -> InstantFrame:
        world = self._blocks.world
        if self._mesh is None:
            self._mesh = Tessellator(world.surfaces).mesh(_dark_field(world))
        device, mesh = drawing.require_device(), self._mesh
        offsets = np.zeros((1, 2))
        if samples > 1:
            random = np.random.default_rng(samples)
            offsets = pattern_points(Pattern.JITTERED_HAMMERSLEY, samples, 1, random)[0] - 0.5
        points = [device.surface_points(mesh, camera, (right, down)) for right, down in offsets.tolist()]
        settings = InstantSettings(
            bound=self._settings.vpl_bound,
            compensates=self._settings.vpl_compensation is not Compensation.NONE,
        )
        surfaces = world.surfaces
        # A solution has diffuse light alone.
        is_diffuse = not (surfaces.has_specular or surfaces.has_directional_emission)
        uses_solution = is_diffuse and self._settings.vpl_compensation is Compensation.SOLUTION
        known = self._known if uses_solution else _nothing
        return InstantFrame(self._blocks, settings, camera, points, known, before)


def _nothing() -> None:
    """No light is known."""


def _dark_field(world: World) -> RadiosityField:
    """The patches themselves, without light."""
    surfaces = world.surfaces
    dark: FloatArray = np.zeros((surfaces.patch_count, 3))
    patch = np.arange(surfaces.patch_count, dtype=np.int32)
    return RadiosityField(surfaces.corners, surfaces.corner_count, patch, surfaces.area, dark, dark)
