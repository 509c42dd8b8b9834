"""Where the time goes from a scene to the finished frame of interpolants: milestones on the clock."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Final, Self

from benchmarks.plan import Job, Options, Section
from benchmarks.report.ours import Clock
from benchmarks.report.telling import seconds_text
from benchmarks.report.views import CAMERA, SMALL_EDITS, edit_to
from benchmarks.tables import Row, Table
from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import FrameRequest, RendererName
from solver.engine.status import SessionState
from solver.engine.warm import warm_up

STAGES: Final = ("opened", "solved", "corrected", "discontinuities", "triangulated", "finished", "drawn")
"""What has been done at each milestone: [H]'s order"""

_SCENES: Final = ("cornell", "office")
_STEP: Final = 0.01
_SHARE: Final = 0.03
"""Seconds between two looks, or the share of what has passed if that is more"""

_REQUEST: Final = FrameRequest(CAMERA, RendererName.INTERPOLANT)


@dataclass(frozen=True)
class Profile:
    """Of one scene by the default settings."""

    scene: str
    case: str
    seconds: tuple[float, ...]
    """That each of `STAGES` took, in their order"""

    @classmethod
    def from_record(cls, record: dict[str, Any]) -> Self:
        """Of what `asdict` made."""
        return cls(**{**record, "seconds": tuple(record["seconds"])})


@dataclass(frozen=True)
class Profiles:
    """Of one process."""

    profiles: tuple[Profile, ...]


def measure_profile(scene: str) -> Profiles:
    """From the scene in memory on, and after its small edit."""
    drawing = Drawing()
    warm_up(drawing)
    loaded, edit = load_sample(scene), SMALL_EDITS[scene]
    for _ in range(2):
        # The second time, so that nothing is loaded any more.
        clock = Clock()
        engine = clock.of(lambda: Engine(loaded, drawing=drawing))
        cold = _stages(engine, clock)
    before = Engine(edit.before(loaded), drawing=drawing)
    _stages(before, Clock())
    clock = Clock()
    clock.of(lambda: before.apply([edit_to(loaded, edit)]))
    return Profiles((Profile(scene, "cold", cold), Profile(scene, "edited", _stages(before, clock))))


def _stages(engine: Engine, clock: Clock) -> tuple[float, ...]:
    at = [clock.seconds]
    while True:
        outlook = clock.of(lambda: engine.outlook(_REQUEST))
        at += [clock.seconds] * (_reached(engine) - len(at))
        if not outlook.improving:
            break
        clock.of(lambda: engine.step(max(_STEP, _SHARE * clock.seconds)))
    at += [clock.seconds] * (len(STAGES) - 1 - len(at))
    start = time.perf_counter()
    engine.frame(_REQUEST)
    at.append(at[-1] + time.perf_counter() - start)
    return tuple(later - sooner for sooner, later in zip((0.0, *at), at, strict=False))


def _reached(engine: Engine) -> int:
    """How many of the first five milestones are past."""
    fine = engine._showing.fine
    if engine._solution.state is SessionState.SOLVING:
        return 1
    if fine is None or fine.point_irradiance is None:
        return 2
    if fine.lines is None:
        return 3
    return 4 if fine.interpolants is None else 5


def section(options: Options) -> Section:
    """The small scenes."""
    jobs = tuple(
        Job(name, measure_profile, (name,))
        for name in options.scenes
        if name in _SCENES[: 1 if options.quick else None]
    )
    return Section("profile", jobs, tabulate)


def tabulate(found: list[Profiles]) -> Table:
    """One row a scene and case."""
    profiles = [profile for one in found for profile in one.profiles]
    return Table(
        "Where the time goes to the finished frame of interpolants",
        ("scene", "case", *STAGES, "in all"),
        tuple(
            Row((p.scene, p.case, *map(seconds_text, p.seconds), seconds_text(sum(p.seconds))))
            for p in profiles
        ),
        "Seconds that each stage took at the default tolerance. Opened: the scene made ready, or the edit "
        "applied; solved: light settled over links; corrected: what links missed put back at every leaf; "
        "discontinuities: found and weighed; finished: all interpolants in view built and refined.",
        names=2,
    )
