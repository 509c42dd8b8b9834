"""Path-traced frames in the making: one for each camera that was asked for lately.

A frame goes on improving until it is within the tolerance, or until nobody has asked for it for a while.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from typing import Final, TypeAlias

from solver.engine.cameras import camera_key
from solver.engine.world import World
from solver.geometry.scene import Camera
from solver.pathtracing import PathTracedFrame, PathTracer

KEPT: Final = 4
"""Frames kept at once; a new camera takes the place of the one asked for longest ago."""

INTEREST: Final = 10.0
"""Seconds for which a frame is worked on after it was last asked for."""

KEPT_PIXELS: Final = 2**22
"""Pixels kept at once, 48 bytes each, unless a single frame has more."""

_SAMPLES_PER_PASS: Final = 4

_Key: TypeAlias = tuple[float, ...]


class AskedFrame:
    """A path-traced frame that somebody asked for."""

    def __init__(self, frame: PathTracedFrame) -> None:
        self.frame = frame
        self.samples = 1
        """Samples of a pixel without which the frame is not shown."""
        self.max_error = math.inf
        """Error of which somebody needs the frame."""
        self.wanted_until = 0.0
        self._error = float("inf")
        self._error_passes = 0

    @property
    def error_estimate(self) -> float:
        """Relative RMS luminance error of the frame; infinite at first. Computed once a pass."""
        if self._error_passes != self.frame.passes:
            self._error_passes, self._error = self.frame.passes, self.frame.error_estimate
        return self._error

    def needs_work(self, tolerance: float) -> bool:
        """Whether the frame is wanted, and too few or too noisy samples are in it."""
        return self.wanted_until > time.monotonic() and not self.is_done(tolerance)

    def is_done(self, tolerance: float) -> bool:
        """Whether it has the samples and the error that were asked for, and is within `tolerance`."""
        return self.frame.samples >= self.samples and self.error_estimate <= min(tolerance, self.max_error)


class PathFrames:
    """The path-traced frames of one world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._tracer: PathTracer | None = None
        self._asked: OrderedDict[_Key, AskedFrame] = OrderedDict()

    def ask(self, camera: Camera, samples: int, max_error: float = math.inf) -> AskedFrame:
        """The frame of `camera` as it stands.

        It is wanted from now on, with at least `samples` a pixel and at most that error.
        """
        key = camera_key(camera)
        asked = self._asked.get(key)
        if asked is None:
            if self._tracer is None:
                self._tracer = PathTracer(self._world.surfaces, self._world.rays)
            asked = self._asked[key] = AskedFrame(self._tracer.frame(camera, _SAMPLES_PER_PASS))
        self._asked.move_to_end(key)
        while len(self._asked) > 1 and (len(self._asked) > KEPT or self._pixels() > KEPT_PIXELS):
            self._asked.popitem(last=False)
        asked.samples = max(asked.samples, samples)
        asked.max_error = min(asked.max_error, max_error)
        asked.wanted_until = time.monotonic() + INTEREST
        return asked

    def _pixels(self) -> int:
        return sum(asked.frame.camera.width * asked.frame.camera.height for asked in self._asked.values())

    def step(self, budget: float, tolerance: float) -> bool:
        """Work for about `budget` seconds on the frame that is furthest behind; False if none needs work."""
        unfinished = [asked for asked in self._asked.values() if asked.needs_work(tolerance)]
        if not unfinished:
            return False
        min(unfinished, key=lambda asked: asked.frame.passes).frame.step(budget)
        return True
