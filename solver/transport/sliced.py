"""A solve that is worked on for a while at a time."""

from __future__ import annotations

import time
from collections.abc import Iterator

from solver.geometry.surfaces import Surfaces
from solver.transport.field import SolveOutcome
from solver.transport.settings import SolverSettings


class SlicedSolve:
    """What solves have in common: work that yields every few milliseconds, and how it stands."""

    def __init__(self, surfaces: Surfaces, settings: SolverSettings) -> None:
        self.surfaces = surfaces
        self.settings = settings
        self.outcome = SolveOutcome.RUNNING
        self.error_estimate = 1.0
        self.unshot_fraction = 1.0
        self.progress = 0.0
        self.version = 0
        """Counts the changes of the field."""
        self._seconds = 0.0
        self._work = self._run()

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; True while more remains."""
        start = time.perf_counter()
        while self.outcome is SolveOutcome.RUNNING:
            if next(self._work, None) is None and self.outcome is SolveOutcome.RUNNING:
                self.outcome = SolveOutcome.CONVERGED
            if time.perf_counter() - start >= budget:
                break
        self._seconds += time.perf_counter() - start
        return self.outcome is SolveOutcome.RUNNING

    @property
    def shots(self) -> int:
        """Links shot over, those of all gathers included."""
        return 0

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know about this solution."""
        told = self.surfaces.warnings
        if self.outcome not in (SolveOutcome.RUNNING, SolveOutcome.CONVERGED):
            told = (*told, self.outcome.value)
        return told

    def _run(self) -> Iterator[bool]:
        """The work; it sets `outcome` unless it ends converged."""
        raise NotImplementedError
