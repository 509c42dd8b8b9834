"""Requests that a worker answers later: when the engine has got far enough, or time is up."""

from __future__ import annotations

import time
from typing import Protocol

from service.hosting.answers import DrawnFrame, draw_frame, drawn
from service.hosting.encoding import PendingFrame
from service.hosting.messages import (
    FrameAnswer,
    GetExport,
    GetFrame,
    GetGrid,
    GetLightmap,
    GetOverlay,
    LightmapAnswer,
    OverlayAnswer,
)
from solver.engine.engine import Engine
from solver.engine.exports.files import Export
from solver.engine.grids import csv_of
from solver.engine.lightmaps.bake import Bake
from solver.engine.lightmaps.files import encode_lightmap, white_of
from solver.engine.overlays.base import Needs, NotReadyError, Work, still_missing
from solver.engine.overlays.files import encode_overlay
from solver.engine.status import SessionState


class Waiting(Protocol):
    """A request that waits."""

    @property
    def deadline(self) -> float:
        """When it must be answered, by the monotonic clock."""

    @property
    def is_working(self) -> bool:
        """Whether it has work of its own, and wants to be polled at once again."""

    def poll(self, engine: Engine) -> object | None:
        """The answer, after a slice of work; None while it waits. Raises REFUSED errors."""


class WaitingFrame:
    """A frame that is not good enough yet."""

    is_working = False

    def __init__(self, request: GetFrame) -> None:
        self._request = request
        self.deadline = time.monotonic() + request.timeout

    def poll(self, engine: Engine) -> FrameAnswer | PendingFrame | None:
        """The frame, to be encoded unless the client has it, if it is as good as asked or its time is up.

        Where the time is a budget, drawing and encoding are to fit into it, by what they took before.
        """
        worth = engine.outlook(drawn(engine, self._request)).is_worth(self._request.wait)
        start = time.monotonic()
        spare = engine.frame_times.expected if self._request.is_budget else 0.0
        if not worth and start < self.deadline - spare:
            return None
        found = draw_frame(engine, self._request)
        if isinstance(found, DrawnFrame):
            return PendingFrame(found, start, engine.frame_times)
        engine.frame_times.learn(time.monotonic() - start)
        return found


class WaitingOverlay:
    """An overlay that cannot be shown yet, or is in the making."""

    def __init__(self, request: GetOverlay, budget: float) -> None:
        """`budget`: seconds of work of one poll."""
        self._request = request
        self._budget = budget
        self._work: Work | None = None
        self.deadline = time.monotonic() + request.timeout

    @property
    def is_working(self) -> bool:
        """Once it is in the making."""
        return self._work is not None

    def poll(self, engine: Engine) -> OverlayAnswer | None:
        """The overlay, once it is made. Raises NotReadyError where its time is up before it can be shown.

        What is in the making is made to its end: where an edit comes between, of the revision before.
        """
        if self._work is None:
            if not self._may_begin(engine):
                return None
            self._work = engine.overlay(self._request.overlay)
        start = time.monotonic()
        while time.monotonic() - start < self._budget:
            try:
                next(self._work)
            except StopIteration as end:
                return OverlayAnswer(encode_overlay(end.value, self._request.format))
        return None

    def _may_begin(self, engine: Engine) -> bool:
        asked = self._request.overlay
        if engine.is_overlay_ready(asked, asked.complete):
            return True
        if time.monotonic() < self.deadline:
            return False
        if not engine.is_overlay_ready(asked, complete=False):
            raise still_missing(asked.overlay.needs)
        return True


class WaitingExport:
    """An export, or a grid, that waits for the light."""

    is_working = False

    def __init__(self, request: GetExport | GetGrid) -> None:
        self._request = request
        self.deadline = time.monotonic() + request.timeout

    def poll(self, engine: Engine) -> Export | None:
        """The file, when the solution rests if it is to, or time is up; making one takes what it takes.

        Raises SceneError, LimitExceededError.
        """
        status = engine.status()
        rests = status.state is not SessionState.SOLVING
        if self._request.complete and not rests and time.monotonic() < self.deadline:
            return None
        if isinstance(self._request, GetExport):
            return engine.export(self._request.export)
        grid, result = engine.measure(self._request.grid)
        return Export(
            content=csv_of(grid, result),
            revision=result.revision,
            error_estimate=status.error_estimate,
            converged=status.state is SessionState.CONVERGED,
        )


class WaitingLightmap:
    """A lightmap that is baked for one client."""

    def __init__(self, request: GetLightmap, budget: float) -> None:
        """`budget`: seconds of work of one poll."""
        self._request = request
        self._budget = budget
        self._bake: Bake | None = None
        self.deadline = time.monotonic() + request.timeout

    @property
    def is_working(self) -> bool:
        """Once it has begun."""
        return self._bake is not None

    def poll(self, engine: Engine) -> LightmapAnswer | None:
        """The lightmap, as good as asked or as it is when time is up. Raises NotReadyError, SceneError.

        Once begun it is baked on for its own revision, where an edit comes between.
        """
        is_late = time.monotonic() >= self.deadline
        if self._bake is None:
            self._bake = engine.bake(self._request.lightmap)
            if self._bake is None and is_late:
                raise still_missing(Needs.POINT)
        if self._bake is None:
            return None
        bake = self._bake
        working = bake.step(self._budget)
        if bake.is_drawable and (is_late or not working or not self._request.complete):
            return self._answer(bake)
        if is_late:
            raise NotReadyError("no texel has all of its light yet: wait longer, or ask for fewer texels")
        return None

    def _answer(self, bake: Bake) -> LightmapAnswer:
        lightmap = bake.lightmap()
        white = white_of(lightmap) if self._request.white is None else self._request.white
        return LightmapAnswer(
            content=encode_lightmap(lightmap, self._request.format, white),
            revision=lightmap.revision,
            width=lightmap.atlas.width,
            height=lightmap.atlas.height,
            density=lightmap.atlas.density,
            white=white,
            method=lightmap.method,
            error_estimate=lightmap.error_estimate,
            converged=lightmap.converged,
        )
