"""Whether memory grows is told by its second half."""

from __future__ import annotations

import os

import pytest

from benchmarks.load_memory import Memory, Trend, memory_table


def test_a_trend_is_that_of_the_second_half() -> None:
    seconds = [10.0 + 5.0 * at for at in range(9)]
    trend = Trend.of(seconds, [0.0, 50.0, 80.0, 90.0, 100.0, 101.0, 102.0, 103.0, 104.0])
    assert trend.start == pytest.approx(100.0)
    assert trend.end == pytest.approx(104.0)
    assert trend.growth == pytest.approx(0.04)


def test_all_kinds_of_processes_are_told() -> None:
    told = [Memory(5.0 * at, 100.0, 30.0, 2000.0 + at, 34) for at in range(12)]
    table = memory_table(told)
    assert "MB of all: 2130, 2133, 2136, 2138, 2141" in table
    assert "    the process that serves: 100.0 to 100.0 MB (+0.00 %)" in table
    assert "    the workers: 2005.5 to 2011.0 MB (+0.27 %)" in table


def test_a_process_is_weighed() -> None:
    found = Memory.of(os.getpid())
    assert found.all >= found.web > 1.0
