"""What trials come to: the frames that no other beats, and the time to an error."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from benchmarks.report.trials import Case, Shot, Trial

GOALS: Final = (0.05, 0.02, 0.01)
"""Errors to which the time is told"""

NOISY: Final = ("path", "Mitsuba path")
"""Renderers whose error is noise, and nothing else"""


@dataclass(frozen=True)
class Reached:
    """How soon an error is reached."""

    seconds: float
    """Infinite where it is not"""
    trial: Trial | None
    """By which"""
    sign: str = ""
    """Of what is not measured: ~ where the time is extrapolated, > where it is a lower bound"""


NEVER: Final = Reached(math.inf, None)


def chosen(trials: Iterable[Trial], scene: str, case: Case, *renderers: str) -> list[Trial]:
    """Those of one view and case, by some renderers, or by all of the project."""
    return [
        trial
        for trial in trials
        if trial.scene == scene
        and trial.case is case
        and (trial.renderer in renderers if renderers else not trial.is_peer)
    ]


def front(shots: Iterable[Shot]) -> list[Shot]:
    """The shots that no other one beats in both time and error, in the order of time."""
    kept: list[Shot] = []
    for shot in sorted(shots, key=lambda s: (s.seconds, s.error)):
        if not kept or shot.error < kept[-1].error:
            kept.append(shot)
    return kept


def reached(trials: Iterable[Trial], goal: float) -> Reached:
    """The first shot of all within `goal`; nothing is interpolated between shots."""
    best = NEVER
    for trial in trials:
        for shot in trial.shots:
            if shot.error <= goal and shot.seconds < best.seconds:
                best = Reached(shot.seconds, trial)
    return best


def reached_by_noise(trials: Iterable[Trial], goal: float) -> Reached:
    """As `reached`; where noise is all the error and no shot is within `goal`, by the law of 1 / sqrt(n).

    The seconds of the last shot times the square of its error over the goal.
    """
    known = [trial for trial in trials if trial.shots]
    best = reached(known, goal)
    if best.trial is not None or not known:
        return best
    last, trial = min(
        ((t.shots[-1], t) for t in known), key=lambda pair: pair[0].error ** 2 * pair[0].seconds
    )
    return Reached(last.seconds * (last.error / goal) ** 2, trial, "~")


def reached_or_later(trials: Iterable[Trial], goal: float) -> Reached:
    """As `reached`; where no shot is within `goal`, the time of the last one that there was time for."""
    known = [trial for trial in trials if trial.shots]
    best = reached(known, goal)
    if best.trial is not None or not known:
        return best
    return Reached(max(trial.shots[-1].seconds for trial in known), known[0], ">")


def told(trials: list[Trial], goal: float) -> Reached:
    """By the law that holds for what has made them: of noise alone, denoised, or by settings."""
    if any(trial.renderer in NOISY for trial in trials):
        return reached_by_noise(trials, goal)
    return (reached_or_later if any(trial.is_peer for trial in trials) else reached)(trials, goal)
