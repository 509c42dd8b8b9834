"""Memory of a service under load: by kind of process, as time goes by, and whether it still grows."""

from __future__ import annotations

import re
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

_TOLD: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Parts of the time after which memory is told"""

_ENOUGH: Final = 6
"""Looks at memory, from which on they tell whether it grows"""


@dataclass(frozen=True)
class Memory:
    """MB of the processes of a service, what they share counted in equal parts.

    Files that they map are left out: they share those with whatever else runs, which comes and goes.
    """

    seconds: float
    """By the monotonic clock"""
    web: float
    """Of the process that serves"""
    nursery: float
    """Of the one that workers are forked from"""
    workers: float
    """Of all of them"""
    count: int
    """Of workers"""

    @staticmethod
    def of(service: int) -> Memory:
        """As it is now."""
        nurseries, workers = _children(service), workers_of(service)
        web, nursery = _shared_out((service,)), _shared_out(nurseries)
        return Memory(time.monotonic(), web, nursery, _shared_out(workers), len(workers))

    @property
    def all(self) -> float:
        """Of all processes together."""
        return self.web + self.nursery + self.workers


@dataclass(frozen=True)
class Trend:
    """A straight line through what was measured in the second half of a time."""

    start: float
    """MB where the half begins"""
    end: float

    @staticmethod
    def of(seconds: Sequence[float], megabytes: Sequence[float]) -> Trend:
        """By least squares, of four moments or more."""
        at, found = np.asarray(seconds), np.asarray(megabytes)
        late = at >= 0.5 * (at[0] + at[-1])
        slope, level = np.polyfit(at[late] - at[-1], found[late], 1)
        return Trend(float(level - 0.5 * slope * (at[-1] - at[0])), float(level))

    @property
    def growth(self) -> float:
        """Over the half, relative."""
        return self.end / self.start - 1.0

    def __str__(self) -> str:
        return f"{self.start:.1f} to {self.end:.1f} MB ({100.0 * self.growth:+.2f} %)"


def memory_table(told: Sequence[Memory]) -> str:
    """MB by kind of process as time went by, and how they grew in its second half."""
    kinds = {
        "all": [found.all for found in told],
        "the process that serves": [found.web for found in told],
        "the nursery": [found.nursery for found in told],
        "the workers": [found.workers for found in told],
    }
    moments = [round(part * (len(told) - 1)) for part in _TOLD]
    lines = [f"MB of {kind}: {', '.join(f'{mb[at]:.0f}' for at in moments)}" for kind, mb in kinds.items()]
    lines.append(f"workers: {', '.join(str(told[at].count) for at in moments)}")
    if len(told) >= _ENOUGH:
        seconds = [found.seconds for found in told]
        lines.append("in the second half, by a straight line:")
        lines += [f"    {kind}: {Trend.of(seconds, megabytes)}" for kind, megabytes in kinds.items()]
    return "\n".join(lines)


def workers_of(service: int) -> list[int]:
    """Process ids; they are forked from a process that is the service's only child."""
    return [worker for nursery in _children(service) for worker in _children(nursery)]


def _children(process: int) -> list[int]:
    listed = Path(f"/proc/{process}/task").glob("*/children")
    return sorted(int(child) for file in listed for child in file.read_text().split())


def _shared_out(processes: Iterable[int]) -> float:
    """MB of some processes; what several share, in equal parts."""
    return sum(map(_shared_out_of, processes))


def _shared_out_of(process: int) -> float:
    try:
        told = Path(f"/proc/{process}/smaps_rollup").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return sum(
        1.024e-3 * int(kb) for kb in re.findall(r"^Pss_(?:Anon|Shmem):\s+(\d+) kB", told, re.MULTILINE)
    )
