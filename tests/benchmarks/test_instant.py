"""The measurements of frames by virtual lights, as small as they get."""

from __future__ import annotations

import pytest

from benchmarks import instant, instant_costs, walkthrough
from benchmarks.plan import Options


def test_errors_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instant, "PATHS", (8, 64))
    figures = instant.measure_instant("cube_room", "main", 64)
    assert [shot.paths for shot in figures.shots] == [8, 64]
    assert figures.shots[0].seconds < figures.shots[1].seconds
    assert 0.0 < figures.first <= figures.shots[0].seconds
    assert 0.3 > figures.shots[0].error > figures.shots[1].error > 0.0
    table = instant.tabulate([figures])
    assert len(table.rows) == 2
    assert all(len(row.cells) == len(table.columns) for row in table.rows)
    assert [target.what for target in table.targets] == ["error"]


def test_costs_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instant_costs, "WIDTH", 45)
    monkeypatch.setattr(instant_costs, "HEIGHT", 36)
    monkeypatch.setattr(instant_costs, "PATHS", 16)
    few, many = instant_costs.measure_costs(1, 1, 0), instant_costs.measure_costs(4, 2, 0)
    assert (few.lamps, many.lamps) == (1, 8)
    assert few.quadrilaterals == many.quadrilaterals == 402
    for figures in (few, many):
        parts = (figures.points_found, figures.walked, figures.looked, figures.lit, figures.compensated)
        assert min(parts) > 0.0
        assert sum(parts) == pytest.approx(figures.seconds)
        assert figures.lights > 16
        assert figures.points == 45 * 36, "the hall is closed"
    table = instant_costs.tabulate([few, many])
    assert len(table.rows) == 4
    assert all(len(row.cells) == len(table.columns) for row in table.rows)
    assert [target.what for target in table.targets] == ["time", "time", "of one lamp"]


def test_walkthroughs_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walkthrough, "WIDTH", 32)
    monkeypatch.setattr(walkthrough, "HEIGHT", 24)
    monkeypatch.setattr(walkthrough, "_MASTER", 64)
    figures = walkthrough.measure_walkthrough(0.02, 3)
    assert figures.paths >= 8
    assert figures.rate > 0.0
    assert 0.0 <= figures.error < 1.0
    table = walkthrough.tabulate([figures])
    assert len(table.rows) == 1
    assert len(table.rows[0].cells) == len(table.columns)


def test_sections_hold_what_there_are_references_for() -> None:
    whole, quick = Options(), Options(("office", "robot_cell"), quick=True)
    assert len(instant.section(whole).jobs) == len(instant.VIEWS)
    assert [job.arguments for job in instant.section(quick).jobs] == [("office", "birds_eye", 512)]
    assert len(instant_costs.section(quick).jobs) == 2
    assert len(walkthrough.section(Options(("cornell",))).jobs) == 0
