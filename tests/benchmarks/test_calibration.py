"""The calibration and the savings as the report shows them."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from benchmarks import savings
from benchmarks.calibration import section
from benchmarks.calibration.measure import Case, Effort, SceneCases, Told, measure_scene
from benchmarks.calibration.rooms import random_room
from benchmarks.plan import Options
from solver.engine.world import World
from solver.transport.settings import Saving

EFFORT = Effort(field=10_000, pixel=8, probe=64, probes=4, tolerances=(0.2,))


@pytest.fixture(scope="module")
def cases() -> SceneCases:
    return measure_scene("cornell", EFFORT)


def test_all_that_tell_errors_are_asked(cases: SceneCases, tmp_path: Path) -> None:
    assert {case.told_by for case in cases.cases} == set(Told)
    table = section.tabulate([cases])
    assert [row.cells[0] for row in table.rows] == [*map(str, Told), "all"]
    assert all(len(row.cells) == len(table.columns) for row in table.rows)
    section.plot([cases], tmp_path)
    assert (tmp_path / "calibration.svg").stat().st_size > 1000
    assert section.from_records(json.loads(json.dumps([asdict(cases)]))) == [cases]


def test_a_case_holds_if_no_more_is_true_than_told() -> None:
    def case(told: float, true: float, noise: float = 0.0) -> Case:
        return Case(Told.STATUS, "room", "at rest", told, true, noise)

    assert case(0.02, 0.02).holds and not case(0.02, 0.021).holds and case(0.02, 0.021, 0.002).holds
    assert case(0.02, 0.01).ratio == pytest.approx(2.0)
    told = SceneCases((case(0.02, 0.01), case(0.02, 0.04), case(1.0, 0.5)))
    last = section.tabulate([told]).rows[-1]
    assert last.cells[1] == "2", "what is told before anything is known is no estimate"
    assert [target.met for target in last.targets] == [False, True]


def test_rooms_are_drawn_by_their_seeds() -> None:
    worlds = [World.of(random_room(seed)) for seed in (1, 1, 2)]
    corners = [world.surfaces.corners for world in worlds]
    assert np.array_equal(corners[0], corners[1])
    assert corners[0].shape != corners[2].shape or not np.array_equal(corners[0], corners[2])
    assert all(world.surfaces.emission.any() for world in worlds)


def test_each_saving_has_its_cost() -> None:
    found = savings.measure_savings("cornell", 0.2, 1)
    assert [cost.in_full for cost in found.costs] == [None, *Saving]
    table = savings.tabulate([found])
    assert len(table.rows) == len(Saving)
    by_name = {cost.in_full: cost for cost in found.costs}
    assert by_name[Saving.RAYS].rays > by_name[None].rays


def test_the_quick_forms_have_less_to_do() -> None:
    for module in (section, savings):
        quick, whole = (module.section(Options(quick=is_quick)) for is_quick in (True, False))
        assert 0 < len(quick.jobs) <= len(whole.jobs)
        assert quick.jobs[0].arguments != whole.jobs[0].arguments
