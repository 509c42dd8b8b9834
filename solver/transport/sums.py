"""Sums over links at elements or patches, by ranges of links on all cores."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from solver.parallel import run_chunks
from solver.types import FloatArray

_MANY: Final = 1 << 16
_PARTS: Final = 2


def part_count(links: int) -> int:
    """Of many links each part has an array of its own to add to; the number is fixed, so that sums are the
    same on any machine."""
    return _PARTS if links >= _MANY else 1


def add_up(add: Callable[[int, int, FloatArray], object], links: int, shape: tuple[int, ...]) -> FloatArray:
    """What `add` of ranges start, stop of so many links adds to an array of this shape."""
    parts = part_count(links)
    total = np.zeros((parts, *shape))

    def work(start: int, stop: int) -> None:
        for part in range(start, stop):
            add(links * part // parts, links * (part + 1) // parts, total[part])

    run_chunks(work, parts, 1)
    return total[0] if parts == 1 else np.asarray(total.sum(axis=0))
