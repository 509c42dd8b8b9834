"""Spread ranges of GIL-free work (numba kernels, Embree queries) over all cores of the process.

numpy's BLAS has threads of its own, which wait for work in a loop and so take a core from all others for a
while after every product of matrices. Nothing here has matrices large enough to be worth that: BLAS gets one.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np  # noqa: F401  (BLAS has to be there to be told)
from threadpoolctl import threadpool_limits

threadpool_limits(limits=1, user_api="blas")

_PIECES_PER_CORE: Final = 3
"""Pieces into which a small range is cut, so that cores end at about the same time."""


@cache
def core_count() -> int:
    """Number of cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=max(1, core_count() - 1), thread_name_prefix="halflight-kernel")


def run_chunks(work: Callable[[int, int], object], count: int, chunk: int, least: int | None = None) -> None:
    """Call `work(start, stop)` over [0, count) in pieces of at most `chunk`, on all cores.

    A range of few chunks is cut finer, into pieces of at least `least`, where given, so that all cores
    have some. `work` must write to disjoint outputs for disjoint ranges, and may call this function itself.
    The caller works too; the first exception raised by a piece is raised here after all pieces have ended.
    """
    if count <= 0:
        return
    number = -(-count // chunk)
    if least is not None:
        number = max(number, min(_PIECES_PER_CORE * core_count(), count // least))
    helpers = min(core_count(), number) - 1
    bounds = [count * k // number for k in range(number + 1)]
    pieces = deque(pairwise(bounds))

    def drain() -> None:
        while True:
            try:
                start, stop = pieces.popleft()
            except IndexError:
                return
            work(start, stop)

    futures = [_pool().submit(drain) for _ in range(helpers)]
    try:
        drain()
    finally:
        # Helpers that have not begun are not waited for: `work` may come from a piece itself, when all
        # threads of the pool are taken.
        begun = [future for future in futures if not future.cancel()]
        errors = [error for future in begun if (error := future.exception()) is not None]
    if errors:
        raise errors[0]
