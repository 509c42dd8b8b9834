"""Error against work: solvers followed slice by slice, with what it takes to look at them left out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from benchmarks.edit_error import EditError, EditWitness
from benchmarks.shooting import Shooting
from solver.redistribution.redistribution import Redistribution
from solver.transport.solve import RadiositySolver
from solver.types import LUMINANCE_WEIGHTS, BoolArray, FloatArray

_PACE: Final = 1.1
"""Growth of the work between two looks"""

_UNSHOT: Final = 1e-4
"""Shooting ends when this part of what was emitted is unshot."""


@dataclass(frozen=True)
class Work:
    """What has been done."""

    cpu: float
    """Seconds of all threads"""
    wall: float
    """Seconds"""
    shots: int
    """Elements that have shot, where elements do"""
    looks: int
    """Links looked at anew, where an edit has touched some"""
    pairs: int
    """Links or pairs of elements that were shot over"""
    rays: int


@dataclass(frozen=True)
class Sample:
    """The error after some work."""

    work: Work
    error: EditError
    to_come: EditError
    """The same against where the method ends: what more work on the same will take away"""


@dataclass(frozen=True)
class Curve:
    """How the error of one method falls."""

    method: str
    samples: tuple[Sample, ...]

    def after(self, seconds: float) -> Sample:
        """The last sample within a CPU time; the first, where that comes later."""
        there = [sample for sample in self.samples if sample.work.cpu <= seconds]
        return there[-1] if there else self.samples[0]

    def within(self, seconds: float) -> Sample:
        """The last sample within a time of the clock; the first, where that comes later."""
        there = [sample for sample in self.samples if sample.work.wall <= seconds]
        return there[-1] if there else self.samples[0]

    def until(self, where_most: float) -> float:
        """CPU seconds until the error where most changes stays within a bound; infinite if it never does."""
        after = float("inf")
        for sample in reversed(self.samples):
            if sample.error.where_most > where_most:
                break
            after = sample.work.cpu
        return after


@dataclass(frozen=True, eq=False)
class Track:
    """What one method came to, and by how much work."""

    method: str
    looks: tuple[tuple[Work, FloatArray], ...]
    """Reflected luminances (m,) of a witness's elements, W/m2"""

    def curve(self, witness: EditWitness, most: BoolArray) -> Curve:
        """The errors, where `most` (m,) tells the elements that change most."""
        _, end = self.looks[-1]
        told = (
            Sample(work, witness.error(luminance, most), witness.error(luminance, most, end))
            for work, luminance in self.looks
        )
        return Curve(self.method, tuple(told))


class Stopwatch:
    """Time of this process and of the clock, of which some is not counted."""

    def __init__(self) -> None:
        self.cpu = self.wall = 0.0
        self._since = (time.process_time(), time.perf_counter())

    def pause(self) -> float:
        """Count up to now; returns the seconds of the clock since it was resumed."""
        cpu, start = self._since
        seconds = time.perf_counter() - start
        self.cpu += time.process_time() - cpu
        self.wall += seconds
        return seconds

    def resume(self) -> None:
        """Count from now on."""
        self._since = (time.process_time(), time.perf_counter())


def follow_solver(method: str, make: Callable[[], RadiositySolver], witness: EditWitness) -> Track:
    """Make a solver and let it end; its making counts as work."""
    watch = Stopwatch()
    solver = make()
    watch.pause()

    def look() -> tuple[Work, FloatArray]:
        # What has arrived is taken in by whoever asks for the field.
        solver.field()
        looks = solver.looks if isinstance(solver, Redistribution) else 0
        work = Work(watch.cpu, watch.wall, 0, looks, solver.shots, solver.statistics().rays)
        return work, witness.luminances(solver.state)

    looks, due, more = [look()], 0.0, True
    while more:
        watch.resume()
        more = solver.step(0.0)
        watch.pause()
        if watch.cpu >= due or not more:
            looks.append(look())
            due = _PACE * watch.cpu
    return Track(method, tuple(looks))


def follow_shooting(method: str, make: Callable[[], Shooting], most: float) -> Track:
    """Shoot until next to nothing is unshot, but for at most about `most` CPU seconds."""
    watch = Stopwatch()
    shooting = make()
    watch.pause()

    def look() -> tuple[Work, FloatArray]:
        pairs = shooting.shots * len(shooting.area)
        work = Work(watch.cpu, watch.wall, shooting.shots, 0, pairs, shooting.ray_count)
        return work, (shooting.radiosity - shooting.emission) @ LUMINANCE_WEIGHTS

    emitted = shooting.unshot.sum()
    looks, due, more = [look()], 0.0, True
    while more:
        watch.resume()
        shooting.shoot()
        watch.pause()
        more = watch.cpu < most and bool(shooting.unshot.sum() > _UNSHOT * emitted)
        if watch.cpu >= due or not more:
            looks.append(look())
            due = _PACE * watch.cpu
    return Track(method, tuple(looks))
