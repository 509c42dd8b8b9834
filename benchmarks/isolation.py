"""Measurements in a process of their own, and what memory a process has taken."""

from __future__ import annotations

import multiprocessing
import re
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def in_own_process(measure: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """What `measure`, a function of a module, returns in a new interpreter, which may raise, too."""
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=fresh) as executor:
        return executor.submit(measure, *args, **kwargs).result()


def peak_memory() -> float:
    """Largest resident size of this process so far, MB (10^6 bytes).

    The kernel's VmHWM. `ru_maxrss` would count what the process that started this one had taken, too.
    """
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    if found is None:
        raise OSError("the kernel does not tell the peak memory of a process")
    return int(found[1]) * 1024 / 1e6


def reset_peak_memory() -> None:
    """Let `peak_memory` tell what is taken from now on: not less than what is still held."""
    Path("/proc/self/clear_refs").write_text("5")
