"""A lane: the wavefront of paths that one thread keeps in flight.

A lane works on one task at a time, a range of items in one pass. Paths that end make room for new ones,
so that waves stay full until the task runs out; between two waves a lane can be left for any time. All
that a task adds up is its own, in an order that depends on nothing outside it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.pathtracing.paths import allocate_paths, allocate_shadow_rays
from solver.pathtracing.sources import Batch, Source
from solver.pathtracing.tables import Emitters, ShadingTables
from solver.pathtracing.walk import arrive, deposit
from solver.types import FloatArray
from solver.visibility.rays import RayScene

WIDTH: Final = 4096
"""Paths in flight: enough to hide the cost of a call, few enough for the second-level cache and for waves
of some milliseconds. At most half of `solver.visibility.rays.CHUNK`, so that a wave's queries stay in
the thread that makes them."""


@dataclass(frozen=True, eq=False)
class Task:
    """Items [start, stop) in pass `turn`."""

    number: int
    turn: int
    start: int
    stop: int
    key: np.uint64


class Lane:
    """One thread's share of an estimate."""

    def __init__(
        self,
        rays: RayScene,
        tables: ShadingTables,
        emitters: Emitters,
        source: Source,
        samples: int,
        claim: Callable[[], Task | None],
        commit: Callable[[Task, FloatArray], None],
    ) -> None:
        """`claim` gives the next task; `commit` takes its sums (items, 3) over `samples` paths an item."""
        self._rays = rays
        self._tables = tables
        self._emitters = emitters
        self._source = source
        self._samples = samples
        self._claim = claim
        self._commit = commit
        self._paths = allocate_paths(WIDTH)
        self._shadows = allocate_shadow_rays(2 * WIDTH)
        self._alive = 0
        self._cast = 0
        self._begun = 0
        self._task: Task | None = None
        self._sums: FloatArray = np.empty((0, 3))
        self.ray_count = 0
        """Rays traced, to the next vertex and to the emitters."""
        self.vertex_count = 0
        """Vertices reached."""

    def run(self, deadline: float) -> None:
        """Work in waves until `time.perf_counter()` passes `deadline` or no task is left; one at least."""
        while True:
            if self._task is None and not self._take():
                return
            self._wave()
            if time.perf_counter() >= deadline:
                return

    def _take(self) -> bool:
        self._task = self._claim()
        if self._task is None:
            return False
        self._sums = np.zeros((self._task.stop - self._task.start, 3))
        self._begun = 0
        return True

    def _wave(self) -> None:
        """Fill up with new paths, trace all rays, and take the paths to what they hit."""
        task = self._task
        if task is None:
            return
        # New paths in the places of those that ended.
        total = len(self._sums) * self._samples
        begun = min(self._begun + WIDTH - self._alive, total)
        self._cast = self._source.begin(
            Batch(task.start, self._samples, task.key), self._begun, begun,
            self._tables, self._emitters, self._paths, self._alive, self._shadows, self._cast,
        )  # fmt: skip
        self._alive += begun - self._begun
        self._begun = begun

        # Light from the emitters.
        cast, alive = self._cast, self._alive
        if cast > 0:
            blocked = self._rays.occluded(self._shadows.origin[:cast], self._shadows.target[:cast])
            deposit(cast, blocked, self._shadows, self._sums)
            self._cast = 0

        # On to the next vertices.
        if alive > 0:
            hits = self._rays.intersect(self._paths.origin[:alive], self._paths.direction[:alive])
            self._alive, self._cast = arrive(
                alive, hits.triangle, hits.distance,
                self._tables, self._emitters, self._paths, self._shadows, self._sums,
            )  # fmt: skip
        self.ray_count += cast + alive
        self.vertex_count += alive

        if self._begun == total and self._alive == 0 and self._cast == 0:
            self._commit(task, self._sums)
            self._task = None
