"""How often to measure, and what of it to tell."""

from __future__ import annotations

import time
from collections.abc import Callable


def best_of(work: Callable[[], object], times: int) -> float:
    """Seconds of the fastest of some runs: what the machine did beside it only ever adds."""
    seconds = []
    for _ in range(times):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def calls_per_second(work: Callable[[int], object], seconds: float, rounds: int = 3) -> float:
    """Calls `work(number)` a second, in the best of some rounds that together last about `seconds`."""
    number, best = 0, 0.0
    for _ in range(rounds):
        start, first = time.perf_counter(), number
        while (spent := time.perf_counter() - start) < seconds / rounds or number == first:
            work(number)
            number += 1
        best = max(best, (number - first) / spent)
    return best
