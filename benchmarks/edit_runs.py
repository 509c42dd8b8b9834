"""What solving takes while nobody looks into it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from solver.redistribution.redistribution import Redistribution
from solver.transport.solve import RadiositySolver

_LONG: Final = 2.0
"""Seconds after which a run is not repeated"""


@dataclass(frozen=True)
class Run:
    """A solve that nobody looked into."""

    cpu: float
    """Seconds of all threads, from the scene to the solution, ray hierarchy included"""
    wall: float
    begun: float
    """Seconds of wall time until it could be stepped"""
    longest_slice: float
    """Seconds of wall time"""
    looks: int
    """Links looked at anew, where an edit has touched some"""
    pairs: int
    """Links shot over"""
    links: int
    rays: int


def run_fastest(prepare: Callable[[], Callable[[], RadiositySolver]], times: int) -> Run:
    """The run of least CPU time, of solvers that are made by what `prepare` returns, which does not count."""
    runs = [_run(prepare())]
    while len(runs) < times and runs[-1].cpu < _LONG:
        runs.append(_run(prepare()))
    return min(runs, key=lambda run: run.cpu)


def _run(make: Callable[[], RadiositySolver]) -> Run:
    cpu, start = time.process_time(), time.perf_counter()
    solver = make()
    begun = before = time.perf_counter()
    longest, more = 0.0, True
    while more:
        more = solver.step(0.0)
        now = time.perf_counter()
        longest, before = max(longest, now - before), now
    cpu = time.process_time() - cpu
    statistics = solver.statistics()
    return Run(
        cpu=cpu,
        wall=before - start,
        begun=begun - start,
        longest_slice=longest,
        looks=solver.looks if isinstance(solver, Redistribution) else 0,
        pairs=solver.shots,
        links=statistics.links,
        rays=statistics.rays,
    )
