"""Tables of figures and targets, and the measurements' own arithmetic."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.frames import moved
from benchmarks.isolation import in_own_process, peak_memory
from benchmarks.tables import Row, Table, Target
from benchmarks.timing import best_of, calls_per_second
from benchmarks.witness import error_of
from solver.document.samples import load_sample

TABLE = Table(
    "Things",
    ("thing", "way", "seconds"),
    (
        Row(("a", "on|off", "1"), (Target("time", 1.0, 2.0, "s"),)),
        Row(("b", "off", "3"), (Target("time", 3.0, 2.0, "s"), Target("share", 0.5, 0.75, at_most=False))),
        Row(("c", "off", "4")),
    ),
    "Measured.",
    names=2,
)


def test_targets_are_met_on_their_side_of_the_bound() -> None:
    assert str(Target("time", 1.0, 2.0, "s")) == "time ≤ 2 s: met"
    assert str(Target("time", 2.1, 2.0, "s")) == "time ≤ 2 s: MISSED"
    assert Target("share", 0.8, 0.75, at_most=False).met
    assert not Target("share", 0.7, 0.75, at_most=False).met
    assert not Target("time", math.nan, 2.0).met
    assert not Target("share", math.nan, 2.0, at_most=False).met


def test_a_table_in_markdown_has_as_many_cells_in_each_line() -> None:
    title, _, *lines, _, note = TABLE.markdown().strip().split("\n")
    assert (title, note) == ("### Things", "Measured.")
    assert lines[:2] == ["| thing | way | seconds | target |", "| --- | --- | ---: | --- |"]
    assert [line.replace("\\|", "").count("|") for line in lines] == [5] * 5
    assert lines[3].endswith("| time ≤ 2 s: MISSED · share ≥ 0.75: MISSED |")


def test_a_table_on_a_terminal_has_the_same_columns() -> None:
    shown = TABLE.rich()
    assert [column.header for column in shown.columns] == ["thing", "way", "seconds", "target"]
    assert [column.justify for column in shown.columns] == ["left", "left", "right", "left"]
    assert shown.row_count == 3


def test_a_table_without_targets_has_no_column_of_them() -> None:
    bare = replace(TABLE, rows=(Row(("a", "on", "1")),))
    assert len(bare.rich().columns) == 3
    assert bare.markdown().splitlines()[2] == "| thing | way | seconds |"


@pytest.mark.parametrize("error", [0.0, 0.01, 0.1])
@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_the_noise_of_the_paths_is_not_in_the_measured_error(error: float, noise: float) -> None:
    rng = np.random.default_rng(5)
    truth, area = rng.uniform(0.5, 2.0, 20_000), rng.uniform(0.1, 1.0, 20_000)
    found = truth * (1.0 + error * rng.choice([-1.0, 1.0], len(truth)))
    first, second = (truth * (1.0 + noise * rng.standard_normal(len(truth))) for _ in range(2))
    measured = error_of(found, first, second, area)
    assert abs(measured.value - error) <= 4.0 * measured.standard_error
    # As much as that many leaves can tell, and no more.
    products = noise**2 + 2.0 * error * noise
    assert measured.standard_error <= 2.0 * math.sqrt(products + error**2) / len(truth) ** 0.25


def test_a_process_of_its_own_tells_its_own_memory_alone() -> None:
    before = in_own_process(peak_memory)
    held = np.ones(50_000_000)
    assert peak_memory() > held.nbytes / 1e6
    assert in_own_process(peak_memory) < before + 0.1 * held.nbytes / 1e6


def test_what_a_process_of_its_own_raises_is_raised_here() -> None:
    with pytest.raises(ZeroDivisionError):
        in_own_process(divmod, 1, 0)


def test_work_is_called_as_often_as_is_told() -> None:
    calls: list[int] = []
    assert best_of(lambda: calls.append(0), 4) < 1.0
    assert len(calls) == 4
    numbers: list[int] = []
    assert calls_per_second(numbers.append, 0.01) > 0.0
    assert numbers == list(range(len(numbers)))


def test_a_moved_camera_goes_round_its_target() -> None:
    camera = load_sample("cornell").cameras["main"]
    eyes = [moved(camera, number).eye for number in range(40)]
    reach = [np.linalg.norm(eye - camera.target) for eye in eyes]
    np.testing.assert_allclose(reach, np.linalg.norm(camera.eye - camera.target))
    np.testing.assert_allclose([eye @ camera.up for eye in eyes], camera.eye @ camera.up, atol=1e-12)
    assert len({tuple(eye) for eye in eyes}) == 40
