"""Frames of the project's renderers, through the engine as a session's worker has it, against the clock.

Each renderer and setting starts from the scene's text, or from an edit of a session that has finished its
frame. The engine is stepped as a session's worker steps it, and now and then a frame is drawn and told
against the truth. The clock holds the work and the drawing of the frame told, but neither the drawing of
frames before it nor the telling.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import resources
from typing import Final, TypeVar

from benchmarks.isolation import peak_memory, reset_peak_memory
from benchmarks.report.trials import Case, Ending, Shot, Trial, Trials
from benchmarks.report.truth import Truth
from benchmarks.report.views import CAMERA, SMALL_EDITS, edit_to
from solver.document.samples import load_sample, parse_scene
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import FrameRequest, RendererName
from solver.engine.warm import warm_up
from solver.illumination.settings import LightSettings

R = TypeVar("R")

TOLERANCES: Final = (0.16, 0.08, 0.04, 0.03, 0.02, 0.01)
"""Settings of what is solved, coarse ones first"""

_BY_SAMPLES: Final = (RendererName.VPL, RendererName.PATH)
"""Made without a solution: one trial has all their frames."""

_FINEST: Final = 1e-4
"""Error of which such frames are wanted"""

_REHEARSED: Final = 1.0
"""Seconds for which a frame is worked on before anything is measured"""

_SEEN: Final = 5.0
"""Seconds for which such a frame is worked on before an edit"""

_STEP: Final = 0.01
"""Seconds of work between two looks at a frame, until some of what has passed is more"""

_SHARE: Final = 0.05
_SPACING: Final = 1.25
"""A frame is drawn when so many times the seconds of the last one have passed."""


@dataclass
class Clock:
    """Seconds of what is done by it, and of nothing else."""

    seconds: float = 0.0

    def of(self, work: Callable[[], R]) -> R:
        """What `work` returns."""
        start = time.perf_counter()
        found = work()
        self.seconds += time.perf_counter() - start
        return found


@dataclass
class Follower:
    """Follows one session's frame until it is finished, or time is up."""

    engine: Engine
    request: FrameRequest
    truth: Truth
    clock: Clock
    limit: float
    """Seconds on the clock"""
    shots: list[Shot] = field(default_factory=list)

    def follow(self) -> Ending:
        """All of its way."""
        while True:
            outlook = self.clock.of(lambda: self.engine.outlook(self.request))
            is_due = not self.shots or self.clock.seconds >= _SPACING * self.shots[-1].seconds
            is_over = not outlook.improving
            is_late = self.clock.seconds >= self.limit
            if outlook.drawable and (is_due or is_over or is_late):
                self._shoot()
            if is_over or is_late:
                return Ending.COMPLETE if is_over else Ending.TIME
            self.clock.of(lambda: self.engine.step(max(_STEP, _SHARE * self.clock.seconds)))

    def _shoot(self) -> None:
        start = time.perf_counter()
        image = self.engine.frame(self.request).image
        drawn = time.perf_counter() - start
        self.shots.append(Shot(self.clock.seconds + drawn, self.truth.error(image)))


def measure_cold(scene: str, renderer: str, tolerances: tuple[float, ...], limit: float) -> Trials:
    """Frames of a sample scene from its text on, by each setting; those after a late one are left out."""
    text = resources.files("solver").joinpath("samples", f"{scene}.json").read_bytes()
    truth, drawing, request = Truth.of(scene), Drawing(), _request(renderer)
    warm_up(drawing)
    _rehearse(drawing, scene, request)
    trials = []
    for tolerance in _settings_of(request, tolerances):
        reset_peak_memory()
        settings, clock = LightSettings(error_tolerance=tolerance), Clock()
        engine = clock.of(partial(_opened, text, settings, drawing))
        follower = Follower(engine, request, truth, clock, limit)
        ending = follower.follow()
        trials.append(_trial(scene, Case.COLD, request, tolerance, follower, ending))
        if ending is Ending.TIME:
            break
    return Trials(tuple(trials))


def measure_edited(scene: str, renderer: str, tolerances: tuple[float, ...], limit: float) -> Trials:
    """Frames after the small edit of a sample scene in a session that had finished its frame, as above."""
    edit, after = SMALL_EDITS[scene], load_sample(scene)
    truth, drawing, request = Truth.of(scene), Drawing(), _request(renderer)
    warm_up(drawing)
    _rehearse(drawing, scene, request)
    trials = []
    for tolerance in _settings_of(request, tolerances):
        reset_peak_memory()
        engine = Engine(edit.before(after), LightSettings(error_tolerance=tolerance), drawing=drawing)
        if not _finished(engine, request, limit):
            break
        engine.frame(request)
        clock = Clock()
        clock.of(partial(engine.apply, [edit_to(after, edit)]))
        follower = Follower(engine, request, truth, clock, limit)
        ending = follower.follow()
        trials.append(_trial(scene, Case.EDITED, request, tolerance, follower, ending))
        if ending is Ending.TIME:
            break
    return Trials(tuple(trials))


def _opened(text: bytes, settings: LightSettings, drawing: Drawing) -> Engine:
    return Engine(parse_scene(text), settings, drawing=drawing)


def _finished(engine: Engine, request: FrameRequest, limit: float) -> bool:
    """Whether the frame, or as much of it as some seconds give where it never is, is there within a limit."""
    by_samples = request.renderer in _BY_SAMPLES
    start = time.perf_counter()
    while engine.outlook(request).improving:
        engine.step(0.1)
        if time.perf_counter() - start > (_SEEN if by_samples else limit):
            return by_samples
    return True


def _request(renderer: str) -> FrameRequest:
    return FrameRequest(CAMERA, RendererName(renderer), max_error=_FINEST)


def _settings_of(request: FrameRequest, tolerances: tuple[float, ...]) -> tuple[float, ...]:
    """Of what is made without a solution one, which goes on beside it as it does in any session."""
    return (LightSettings().error_tolerance,) if request.renderer in _BY_SAMPLES else tolerances


def _rehearse(drawing: Drawing, scene: str, request: FrameRequest) -> None:
    """One frame of the scene, coarse: what is loaded at the first frame of a size is not measured."""
    engine = Engine(load_sample(scene), LightSettings(error_tolerance=0.3), drawing=drawing)
    small = replace(request, camera=replace(request.camera, width=64, height=48))
    start = time.perf_counter()
    while engine.outlook(small).improving and time.perf_counter() - start < _REHEARSED:
        engine.step(0.1)
    engine.frame(replace(request, renderer=RendererName.GOURAUD))


def _trial(
    scene: str, case: Case, request: FrameRequest, tolerance: float, follower: Follower, ending: Ending
) -> Trial:
    assert request.renderer is not None
    by_samples = request.renderer in _BY_SAMPLES
    return Trial(
        scene=scene,
        case=case,
        renderer=request.renderer.value,
        setting="" if by_samples else f"{100.0 * tolerance:g} %",
        shots=tuple(follower.shots),
        ending=ending,
        peak_memory=peak_memory(),
    )
