"""Each measurement, as small as it gets: it runs, and its table has a row for each of its figures."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import accuracy, frames, occlusion, patterns, serving, solving, walks
from benchmarks.plan import Options
from benchmarks.tables import Table

ROOT = Path(__file__).resolve().parents[2]


def bench(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "benchmarks", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


def assert_whole(table: Table, rows: int, *columns: str) -> None:
    assert len(table.rows) == rows
    assert set(columns) <= set(table.columns)
    for row in table.rows:
        assert len(row.cells) == len(table.columns)


@pytest.fixture(scope="module")
def solved() -> solving.SolveFigures:
    return solving.measure_solve("cornell", 0.08, 2, 1 << 14)


def test_a_solve_is_measured(solved: solving.SolveFigures) -> None:
    assert solved.converged
    assert solved.runs == 2
    assert 0.0 < solved.longest_slice <= solved.seconds
    assert solved.estimated_error <= solved.tolerance == 0.08
    assert 0.0 < solved.measured.value < 0.16
    assert 0 < solved.memory_of_imports <= solved.peak_memory
    assert solved.elements > solved.polygons
    assert_whole(
        solving.tabulate([solved]),
        1,
        *("scene", "seconds", "elements", "links", "rays", "rounds", "estimated error", "measured error"),
        *("peak MB", "MB of imports", "longest slice ms"),
    )
    told = [target.what for target in solving.tabulate([solved]).targets]
    assert told == ["time", "error"]


def test_a_solve_that_does_not_converge_meets_no_target(solved: solving.SolveFigures) -> None:
    stopped = solving.SolveFigures(**{**vars(solved), "seconds": 0.01, "converged": False})
    table = solving.tabulate([stopped])
    assert "not converged" in table.markdown()
    assert not table.targets[0].met


def test_errors_stand_beside_the_time_of_the_default_tolerance(solved: solving.SolveFigures) -> None:
    usual = solving.SolveFigures(**{**vars(solved), "tolerance": 0.02, "seconds": 2.0 * solved.seconds})
    table = accuracy.tabulate([solved, usual])
    assert_whole(table, 2, "scene", "tolerance", "seconds", "measured error")
    shares = [row.cells[table.columns.index("time of default's")] for row in table.rows]
    assert shares == ["0.50", "1.00"]


def test_rays_are_measured() -> None:
    figures = occlusion.measure_rays(1 << 15)
    assert 0.2 < figures.blocked < 0.8
    assert min(way.rate for way in figures.ways) > 0.0
    alone, one_thread = figures.ways[2:]
    assert alone.of_embreex == one_thread.of_one_thread == 1.0
    assert_whole(occlusion.tabulate([figures]), 4, "way", "threads", "of embreex alone", "of one thread")
    assert occlusion.tabulate([figures]).targets[0].value == figures.ways[0].of_embreex


def test_rings_are_what_they_say() -> None:
    triangles = occlusion.random_rings(np.random.default_rng(2))
    assert triangles.shape == (occlusion.TRIANGLES, 3, 3)
    crosses = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.linalg.norm(crosses, axis=1).min() > 0.0
    # Closed surfaces: what they face adds up to nothing.
    np.testing.assert_allclose(crosses.sum(axis=0), 0.0, atol=1e-12)


def test_frames_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames, "WIDTH", 64)
    monkeypatch.setattr(frames, "HEIGHT", 48)
    figures = frames.measure_frames("cornell", 0.03)
    assert min(figures.flat, figures.gouraud, figures.four_samples, figures.jpeg, figures.path) > 0.0
    assert figures.new_light > 0.0 and figures.new_leaves > 0.0
    assert_whole(frames.tabulate([figures]), 8, "scene", "way", "frames / s")


def test_patterns_are_measured() -> None:
    figures = patterns.measure_pattern("jittered", 4, 1)
    assert len(figures.errors) == patterns.MOST
    assert_whole(patterns.tabulate([figures]), 1, "pattern", "1 samples", "64 samples", "slope")


def test_walks_are_measured() -> None:
    figures = walks.measure_walks(16, 2)
    assert [hall.lamps for hall in figures.halls] == [1, 8, 248]
    assert all(hall.seconds > 0.0 and hall.lights >= 16 for hall in figures.halls)
    table = walks.tabulate([figures])
    assert_whole(table, 3, "paths", "lamps", "lights", "ms", "of one lamp")
    assert [target.what for target in table.targets] == ["of one lamp"]


@pytest.mark.slow
def test_a_service_is_measured() -> None:
    figures = serving.measure_service(1)
    assert all(0.0 < latency.least <= latency.median <= latency.most for latency in figures.all)
    assert figures.created.median <= figures.first_frame.median
    assert_whole(serving.tabulate([figures]), 6, "request", "median ms")


@pytest.mark.parametrize("quick", [True, False])
def test_sections_measure_the_scenes_asked_for(quick: bool) -> None:
    options = Options(("robot_cell", "office"), quick)
    assert [job.label for job in solving.section(options).jobs] == ["robot_cell", "office"]
    assert [job.arguments[:2] for job in accuracy.section(options).jobs] == [
        ("office", tolerance) for tolerance in accuracy.TOLERANCES
    ]
    assert [job.label for job in frames.section(options).jobs] == ["office"]


def test_the_command_prints_a_table_and_writes_all_figures(tmp_path: Path) -> None:
    file = tmp_path / "figures.json"
    done = bench("--only", "rays", "--markdown", "--json", str(file), "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "### Shadow rays a second" in done.stdout
    assert " of 1 targets met; measured in " in done.stdout.strip().splitlines()[-1]
    told = json.loads(file.read_text())
    assert told["machine"]["cores"] >= 1
    assert told["options"]["quick"] is True
    assert told["rays"][0]["triangles"] == occlusion.TRIANGLES


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(["--scenes", "attic"], "'attic' is none of cornell"), (["--only", "solve,none"], "'none' is none of")],
)
def test_the_command_refuses_what_it_does_not_know(arguments: list[str], message: str) -> None:
    done = bench(*arguments)
    assert done.returncode == 2
    assert message in done.stderr


def test_the_command_explains_itself() -> None:
    done = bench("--help")
    assert done.returncode == 0
    for option in ("--scenes", "--only", "--full", "--out", "--markdown", "--json"):
        assert option in done.stdout
