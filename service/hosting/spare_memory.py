"""A worker gives back the memory that it does not use: what cycles hold, and what the C library keeps.

Edits replace arrays by others of other sizes, so that the heap becomes a sieve: it grows for as long as a
session is edited and nobody asks for the holes back, though nothing is held in them. To ask costs some
milliseconds, so that it is done now and then while there is work, and once after it.
"""

from __future__ import annotations

import ctypes
import gc
import time
from collections.abc import Callable
from functools import cache
from typing import Final

_INTERVAL: Final = 5.0
"""Seconds between two times, at least"""

_SHARE: Final = 0.005
"""Of the worker's time that it may take"""


class SpareMemory:
    """When it is given back."""

    def __init__(self, interval: float = _INTERVAL) -> None:
        """`interval`: seconds between two times, at least."""
        self._interval = interval
        self._due: float | None = None
        self._next = 0.0

    @property
    def due(self) -> float | None:
        """When there will be something to give back, by the monotonic clock; None where there will not."""
        return self._due

    def note(self) -> None:
        """Something has been done, which may have left some."""
        if self._due is None:
            self._due = max(self._next, time.monotonic() + self._interval)

    def give_back(self) -> None:
        """Give back what is due."""
        start = time.monotonic()
        if self._due is None or start < self._due:
            return
        self._due = None
        give_back()
        end = time.monotonic()
        self._next = end + (end - start) / _SHARE


def give_back() -> None:
    """Let go of what nobody uses any more, and of what the C library keeps for later."""
    gc.collect()
    _trim()(0)


@cache
def _trim() -> Callable[[int], object]:
    """What tells the C library to; nothing where it is none of GNU."""
    found: Callable[[int], object] = getattr(ctypes.CDLL(None), "malloc_trim", lambda _: 0)
    return found
