"""Spread ranges of GIL-free work (numba kernels, Embree queries) over all cores of the process."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache


def core_count() -> int:
    """Number of cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=core_count(), thread_name_prefix="halflight-kernel")


def run_chunks(work: Callable[[int, int], object], count: int, chunk: int) -> None:
    """Call `work(start, stop)` over [0, count) in pieces of at most `chunk`, on all cores.

    `work` must write to disjoint outputs for disjoint ranges. A range of one piece runs in the caller.
    The first exception raised by a piece is raised here after all pieces have ended.
    """
    if count <= 0:
        return
    pieces = [(start, min(start + chunk, count)) for start in range(0, count, chunk)]
    if len(pieces) == 1 or core_count() == 1:
        for start, stop in pieces:
            work(start, stop)
        return
    futures = [_pool().submit(work, start, stop) for start, stop in pieces]
    errors = [error for future in futures if (error := future.exception()) is not None]
    if errors:
        raise errors[0]
