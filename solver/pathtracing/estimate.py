"""Progressive estimates: pass upon pass of samples, each an independent scramble, with an honest error.

Samples within a pass are stratified and therefore not independent; passes are. The standard error is
that of the mean of the passes, from their own spread, and claims nothing about what is inside a pass.
Results depend on the seed only, not on the number of threads or on how the work was sliced: sums are
committed in the order of the tasks, whatever order they end in.
"""

from __future__ import annotations

import threading
import time
from typing import Final

import numpy as np

from solver.parallel import core_count, run_chunks
from solver.pathtracing.lane import Lane, Task
from solver.pathtracing.sources import Source
from solver.pathtracing.tables import Emitters, ShadingTables
from solver.types import FloatArray
from solver.visibility.rays import RayScene

TASK_PATHS: Final = 32768
"""Paths in a task, about: many waves, so that its thin last ones do not weigh; few enough to share out."""


class ProgressiveEstimate:
    """The running mean of an estimate of n items, (n, 3), and its standard error."""

    def __init__(
        self,
        rays: RayScene,
        tables: ShadingTables,
        emitters: Emitters,
        source: Source,
        samples_per_pass: int,
        seed: int,
        passes: int | None = None,
    ) -> None:
        """Nothing is traced yet. Without `passes` the estimate can go on for ever."""
        if samples_per_pass < 1:
            raise ValueError(f"samples_per_pass must be at least 1, not {samples_per_pass}")
        self.samples_per_pass = samples_per_pass
        self._seed = seed
        self._passes = passes
        self._items = source.item_count
        self._items_per_task = max(1, TASK_PATHS // samples_per_pass)
        self._tasks_per_pass = -(-self._items // self._items_per_task)
        self._lock = threading.Lock()
        self._next_claim = 0
        self._next_commit = 0
        self._waiting: dict[int, tuple[Task, FloatArray]] = {}
        self._mean = np.zeros((self._items, 3))
        self._squares = np.zeros((self._items, 3))
        self._turns = np.zeros(self._items, dtype=np.int64)
        self._lanes = [
            Lane(rays, tables, emitters, source, samples_per_pass, self._claim, self._commit)
            for _ in range(core_count())
        ]

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds of wall time on all cores; True while more can be done.

        Overruns by one wave at most, a few milliseconds.
        """
        deadline = time.perf_counter() + budget

        def work(start: int, stop: int) -> None:
            for lane in self._lanes[start:stop]:
                lane.run(deadline)

        if not self.finished:
            run_chunks(work, len(self._lanes), 1)
        return not self.finished

    def run(self) -> None:
        """Work until all passes are done; only for an estimate with a number of passes."""
        if self._passes is None:
            raise ValueError("an estimate without a number of passes does not end")
        while self.step(1.0):
            pass

    @property
    def finished(self) -> bool:
        """Whether every pass asked for is in the mean."""
        return self._items == 0 or (self._passes is not None and self.passes >= self._passes)

    @property
    def passes(self) -> int:
        """Passes complete over all items."""
        return self._next_commit // max(1, self._tasks_per_pass)

    @property
    def mean(self) -> FloatArray:
        """(n, 3) mean so far; 0 for items that no pass has reached."""
        with self._lock:
            return self._mean.copy()

    @property
    def standard_error(self) -> FloatArray:
        """(n, 3) standard error of the mean; infinite where fewer than two passes tell."""
        with self._lock:
            turns = self._turns[:, None]
            several = turns > 1
            variance = self._squares / np.where(several, turns * (turns - 1), 1)
            return np.where(several, np.sqrt(variance), np.inf)

    @property
    def ray_count(self) -> int:
        """Rays traced so far, shadow rays included."""
        return sum(lane.ray_count for lane in self._lanes)

    @property
    def vertex_count(self) -> int:
        """Path vertices reached so far."""
        return sum(lane.vertex_count for lane in self._lanes)

    def _claim(self) -> Task | None:
        with self._lock:
            number = self._next_claim
            turn, part = divmod(number, max(1, self._tasks_per_pass))
            if self._passes is not None and turn >= self._passes:
                return None
            self._next_claim += 1
        start = part * self._items_per_task
        stop = min(start + self._items_per_task, self._items)
        return Task(number, turn, start, stop, _pass_key(self._seed, turn))

    def _commit(self, task: Task, sums: FloatArray) -> None:
        """Take finished tasks into the mean in their order (Welford's update)."""
        with self._lock:
            self._waiting[task.number] = (task, sums)
            while self._next_commit in self._waiting:
                done, total = self._waiting.pop(self._next_commit)
                rows = slice(done.start, done.stop)
                value = total / self.samples_per_pass
                self._turns[rows] += 1
                change = value - self._mean[rows]
                self._mean[rows] += change / (done.turn + 1)
                self._squares[rows] += change * (value - self._mean[rows])
                self._next_commit += 1


def _pass_key(seed: int, turn: int) -> np.uint64:
    """Hashed seed of a pass, 32 bits."""
    return np.uint64(np.random.SeedSequence((seed, turn)).generate_state(1)[0])
