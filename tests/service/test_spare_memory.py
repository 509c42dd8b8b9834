"""Memory that nobody uses is given back, now and then."""

from __future__ import annotations

import gc
import time
import weakref

import numpy as np
import pytest

from service.hosting.memory_limit import _resident
from service.hosting.spare_memory import SpareMemory, give_back


class Ring:
    """What only the collector frees."""

    def __init__(self) -> None:
        self.itself = self


def test_the_holes_of_a_heap_are_given_back() -> None:
    arrays = [np.ones(2500) for _ in range(4000)]  # of 20 kB: small enough to be taken from the heap
    held = _resident()
    kept = arrays[::8]
    del arrays
    give_back()
    assert held - _resident() > 40e6
    assert len(kept) == 500


def test_it_is_done_when_it_is_due_and_not_again() -> None:
    gc.collect()
    spare = SpareMemory(interval=0.05)
    assert spare.due is None
    spare.note()
    due = spare.due
    assert due is not None
    spare.note()
    assert spare.due == due, "what is done meanwhile puts nothing off"
    ring = Ring()
    seen = weakref.ref(ring)
    del ring
    spare.give_back()
    assert seen() is not None
    time.sleep(0.06)
    spare.give_back()
    assert seen() is None
    assert spare.due is None


def test_what_takes_long_is_done_seldom(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.hosting.spare_memory.give_back", lambda: time.sleep(0.05))
    spare = SpareMemory(interval=0.0)
    spare.note()
    spare.give_back()
    spare.note()
    assert spare.due is not None
    assert spare.due - time.monotonic() > 5.0
