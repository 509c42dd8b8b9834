"""How much to do between two yields: batches sized by the time that the last ones took."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from typing import Final, TypeVar

import numpy as np

from solver.types import Int64Array

R = TypeVar("R")

SLICE: Final = 0.012
"""Seconds that a batch should take."""

_SHORTEST: Final = 0.3
"""Part of a slice that a batch may be made for, where there is not more time than that"""

_FIRST: Final = 64.0
_LEAST: Final = 8.0
_MOST: Final = 32768.0


class Pace:
    """Cuts ranges of work into batches; the time between two batches counts for the first of them."""

    def __init__(self, first: float = _FIRST) -> None:
        """Begin with a batch of so many items, where each costs 1."""
        self._cost = first
        self._away = 0.0
        self._left: float | None = None
        self._until = 0.0

    def pause(self) -> None:
        """The work rests: the time until it goes on is no batch's."""
        self._left = time.perf_counter()

    def resume(self, budget: float = 0.0) -> None:
        """The work goes on, for `budget` seconds if that is not 0: the last batches of them are shorter."""
        self._until = time.perf_counter() + budget
        if self._left is not None:
            self._away += time.perf_counter() - self._left
            self._left = None

    def batches(self, costs: Int64Array) -> Iterator[slice]:
        """Slices of a range of items with `costs` (n,) relative to each other, in order."""
        ends = np.cumsum(costs)
        first = 0
        while first < len(costs):
            done = int(ends[first - 1]) if first else 0
            now = time.perf_counter()
            left = self._until - now
            share = min(1.0, max(_SHORTEST, left / SLICE)) if left > 0.0 else 1.0
            # A float would have all of `ends` converted, every time.
            most = done + int(share * self._cost)
            last = max(first + 1, int(np.searchsorted(ends, most, side="right")))
            start = now - self._away
            yield slice(first, last)
            seconds = time.perf_counter() - self._away - start
            rate = (int(ends[last - 1]) - done) / max(seconds, 1e-6)
            self._cost = min(_MOST, max(_LEAST, min(4.0 * self._cost, SLICE * rate)))
            first = last


def steps(work: Generator[object, None, R]) -> Generator[bool, None, R]:
    """The same work, which yields True at every step."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: R = end.value
            return result
        yield True


def finish(work: Generator[object, None, R]) -> R:
    """What `work` comes to, in one go."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: R = end.value
            return result
