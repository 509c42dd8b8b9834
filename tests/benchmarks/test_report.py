"""The report of speed against error: its arithmetic, truths and scenes, and a small measurement of each."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.machine import Machine
from benchmarks.plan import SCENES, Options
from benchmarks.report import document, ours, peers, profile, runs, scaling, sections, truth
from benchmarks.report.front import front, reached, reached_by_noise, told
from benchmarks.report.halls import FAMILIES, icosphere
from benchmarks.report.trials import Case, Ending, Shot, Trial, Trials
from benchmarks.report.truth import Truth
from benchmarks.report.views import CAMERA, SMALL_EDITS, edit_to
from benchmarks.tables import Table
from solver.document.edits import apply_edits
from solver.document.samples import load_sample
from solver.engine.world import World
from solver.geometry.surfaces import flatten
from tests.benchmarks.test_measurements import assert_whole

REFERENCE = Path(__file__).parents[1] / "data" / "reference"


def trial(*shots: tuple[float, float], renderer: str = "gouraud", **given: object) -> Trial:
    known = {"scene": "cornell", "case": Case.COLD, "setting": "2 %", "ending": Ending.COMPLETE}
    made = tuple(Shot(*shot) for shot in shots)
    return Trial(**{**known, "renderer": renderer, "shots": made, "peak_memory": 1.0, **given})  # type: ignore[arg-type]


def test_the_front_has_what_nothing_beats() -> None:
    shots = [Shot(1.0, 0.5), Shot(2.0, 0.6), Shot(3.0, 0.1), Shot(0.5, 0.7), Shot(3.0, 0.2)]
    assert front(shots) == [Shot(0.5, 0.7), Shot(1.0, 0.5), Shot(3.0, 0.1)]
    assert front([]) == []


def test_an_error_is_reached_by_the_first_frame_within_it() -> None:
    slow, soon = trial((1.0, 0.5), (4.0, 0.001)), trial((2.0, 0.02), (3.0, 0.05))
    assert reached([slow, soon], 0.02).seconds == 2.0
    assert reached([slow, soon], 0.01).trial is slow
    assert reached([soon], 0.01).seconds == math.inf


def test_noise_falls_by_the_root_of_the_samples() -> None:
    noisy = trial((1.0, 0.4), (4.0, 0.2), (16.0, 0.1))
    found = reached_by_noise([noisy], 0.01)
    assert found.sign == "~"
    assert found.seconds == pytest.approx(1600.0)
    assert reached_by_noise([noisy], 0.2).seconds == 4.0
    assert reached_by_noise([noisy], 0.2).sign == ""


def test_what_is_denoised_is_not_extrapolated() -> None:
    known = [trial((1.0, 0.4), (4.0, 0.2), renderer=peers.DENOISED, is_peer=True)]
    assert told(known, 0.3).seconds == 4.0
    assert (told(known, 0.01).seconds, told(known, 0.01).sign) == (4.0, ">")
    assert told([trial((1.0, 0.1), renderer="path")], 0.01).sign == "~"
    assert told([trial((1.0, 0.1))], 0.01).seconds == math.inf


def test_the_noise_of_a_truth_is_not_in_an_error() -> None:
    rng = np.random.default_rng(3)
    right = rng.uniform(0.5, 2.0, 20_000)
    first, second = (right * (1.0 + 0.1 * rng.standard_normal(len(right))) for _ in range(2))
    known = Truth(200, 100, np.arange(len(right)), first, second)
    shown = right * (1.0 + 0.03 * rng.choice([-1.0, 1.0], len(right)))
    image = np.repeat(shown[:, None], 3, axis=1).reshape(100, 200, 3)
    assert known.error(image) == pytest.approx(0.03, rel=0.05)
    assert known.floor == pytest.approx(0.1 * np.sqrt(2.0 / np.sqrt(len(right))), rel=0.2)


@pytest.mark.parametrize(("scene", "pixels"), [("cornell", 3.75), ("office", 8.0), ("cube_room", 8.0)])
def test_truths_agree_with_frames_that_the_project_did_not_compute(scene: str, pixels: float) -> None:
    """Of coarser pixels: those of a truth lie inside them. Where light is uneven, they show others."""
    known = Truth.of(scene)
    with np.load(REFERENCE / f"{scene}.main.luminance.npz") as file:
        expected, mask = file["luminance"].astype(np.float64), file["mask"]
    around = np.lib.stride_tricks.sliding_window_view(np.pad(expected, 1, mode="edge"), (3, 3))
    mask &= around.max(axis=(2, 3)) < 1.2 * around.min(axis=(2, 3))
    row, column = known.pixels // known.width, known.pixels % known.width
    beside = (known.width - pixels * mask.shape[1]) / 2.0
    i, j = (np.floor((at + 0.5) / pixels).astype(int) for at in (row, column - beside))
    is_told = (j >= 0) & (j < mask.shape[1])
    is_told[is_told] &= mask[i[is_told], j[is_told]]
    found = 0.5 * (known.first + known.second)[is_told]
    there = expected[i[is_told], j[is_told]]
    assert is_told.mean() > 0.5
    assert found.mean() == pytest.approx(there.mean(), rel=0.002)
    # The rest is what light differs by within a coarse pixel, and noise.
    assert np.sqrt(np.mean((found - there) ** 2) / np.mean(there**2)) < 0.03


def test_every_scene_has_a_truth_that_tells_small_errors() -> None:
    for scene in SCENES:
        known = Truth.of(scene)
        assert (known.width, known.height) == (CAMERA.width, CAMERA.height)
        assert known.floor < 0.003
        assert known.error(np.zeros((known.height, known.width, 3))) == pytest.approx(1.0, abs=0.01)


def test_a_truth_is_made_of_pixels_that_show_one_patch() -> None:
    scene = load_sample("cornell")
    world, camera = World.of(scene), CAMERA.resolve(scene)
    shown = truth.footprints(world, camera, truth.chosen_pixels(camera, 1)[::50])
    plane, corner = world.surfaces.normal[shown.patch], world.surfaces.corners[shown.patch, 0]
    height = np.einsum("ijk,ik->ij", shown.positions - corner[:, None], plane)
    assert np.abs(height).max() < 1e-9
    assert not world.surfaces.emission[shown.patch].any()
    found = truth.traced(world, shown, 64, 7)
    assert np.isfinite(found).all() and found.min() >= 0.0


@pytest.mark.parametrize("scene", SCENES)
def test_small_edits_lead_to_the_sample(scene: str) -> None:
    after, edit = load_sample(scene), SMALL_EDITS[scene]
    before = edit.before(after)
    assert not np.allclose(flatten(before).corners, flatten(after).corners)
    np.testing.assert_allclose(
        flatten(apply_edits(before, [edit_to(after, edit)])).corners, flatten(after).corners, atol=1e-12
    )


@pytest.mark.parametrize("family", FAMILIES.values(), ids=lambda family: family.name)
def test_made_scenes_have_as_many_polygons_as_is_said(family: object) -> None:
    assert hasattr(family, "of")
    for polygons in (320, 1_280):
        surfaces = flatten(family.of(polygons))
        assert 0.75 < surfaces.face_count / polygons < 1.25
        assert not surfaces.warnings


@pytest.mark.parametrize("times", [0, 2])
def test_a_sphere_is_closed_and_faces_outwards(times: int) -> None:
    points, triangles = icosphere(times)
    assert len(triangles) == 20 * 4**times
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0)
    a, b, c = points[triangles].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    assert np.einsum("ij,ij->i", normals, a).min() > 0.0
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-12)


def test_exponents_are_those_of_power_laws() -> None:
    found = scaling.exponent((100, 1000, 10_000, 100_000), (0.1, 1.0, 10.0, None))
    assert found is not None and found.value == pytest.approx(1.0)
    assert (found.least, found.most) == (100, 10_000)
    assert scaling.exponent((100, 1000, 10_000), (0.1, 1.0, None)) is None


@pytest.fixture(scope="module")
def cold() -> Trials:
    return ours.measure_cold("cornell", "gouraud", (0.3,), 5.0)


def test_frames_are_followed_from_a_scene_on(cold: Trials) -> None:
    (found,) = cold.trials
    assert found.ending is Ending.COMPLETE
    times = [shot.seconds for shot in found.shots]
    assert times == sorted(times) and times[0] > 0.0
    assert found.shots[-1].error < 0.5 * found.shots[0].error
    assert found.peak_memory > 0.0


def test_frames_are_followed_from_an_edit_on() -> None:
    (found,) = ours.measure_edited("cornell", "gouraud", (0.3,), 5.0).trials
    assert found.case is Case.EDITED and found.ending is Ending.COMPLETE
    assert found.shots[-1].error < 0.5


def test_sizes_are_measured() -> None:
    size = scaling.measure_size("sphere", 320, 0.2)
    assert size.polygons == 327 and size.is_linked
    assert size.first_frame > 0.0
    assert_whole(sections.tabulate_scaling([size]), 2, "polygons", "elements", "MB")


def test_peers_that_are_not_there_are_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "_PACKAGES", ("no_such_package",))
    found = peers.measure_peer("cornell", True, 1.0)
    assert found.missing == "not installed: no_such_package (pip install .[peers])"
    assert "not installed" in sections.tabulate_peers([found]).markdown()


def test_the_report_is_whole_and_reads_back(cold: Trials, tmp_path: Path) -> None:
    """A second run of one section leaves the others."""
    machine, options = Machine.this(), Options(("cornell",), True)
    stages = profile.Profiles((profile.Profile("cornell", "cold", tuple(range(7))),))
    size = scaling.Size("sphere", 327, 333, True, 0.1, 1.0, 0.05, 900, 8000, None, 100.0)
    gone = Trials((), "not installed: mitsuba (pip install .[peers])")
    rival = Trials((trial((20.0, 0.009), renderer=peers.DENOISED, is_peer=True),))
    made: dict[str, tuple[list[Any], Table]] = {
        "cold": ([cold], sections.tabulate_cold([cold])),
        "peers": ([gone], sections.tabulate_peers([gone])),
        "profile": ([stages], profile.tabulate([stages])),
        "scaling": ([size], sections.tabulate_scaling([size])),
    }
    file = tmp_path / "performance" / "figures.json"
    for name, (found, table) in made.items():
        run = runs.Run.of(machine, options, 1.0, found, table)
        runs.save(file, {**runs.load(file), name: run})
    known = runs.load(file)
    assert list(known) == list(made)
    assert runs.trials_of(known) == list(cold.trials)
    assert runs.sizes_of(known) == [size]
    text = document.write(tmp_path, known).read_text()
    assert "Peers: not installed: mitsuba" in text
    for plot in ("cornell_cold.svg", "scaling_time.svg", "scaling_memory.svg"):
        assert f"performance/{plot}" in text
        assert (tmp_path / "performance" / plot).stat().st_size > 0
    run = runs.Run.of(machine, options, 1.0, [rival], sections.tabulate_peers([rival]))
    runs.save(file, {**known, "peers": run})
    again = runs.load(file)["cold"].joined(known["cold"])
    assert again == known["cold"]
    office = replace(
        known["cold"], figures=[{"trials": [{"scene": "office", "renderer": "flat"}]}], commit="b"
    )
    joined = office.joined(known["cold"])
    assert [one["trials"][0]["scene"] for one in joined.figures] == ["cornell", "office"]
    assert joined.commit.endswith(", b")
    assert "Peers: " not in document.write(tmp_path, runs.load(file)).read_text()
    assert runs.trials_of(runs.load(file)) == [*cold.trials, *rival.trials]


def test_a_trial_without_a_frame_has_a_row() -> None:
    """Where time is up before there is anything to show."""
    nothing = trial(renderer="gather", ending=Ending.TIME)
    table = sections.tabulate_cold([Trials((nothing,))])
    assert_whole(table, 1, "scene", "first frame", "last frame")
    assert "…" in table.rows[0].cells
    assert reached([nothing], 0.5).trial is None
    assert told([trial(renderer="path")], 0.5).trial is None


def test_the_quick_form_is_smaller_than_the_full_one() -> None:
    quick, full = Options(SCENES[:3], True), Options(SCENES, False)
    for section in (sections.cold, sections.edited, sections.peers, sections.scaling):
        assert 0 < len(section(quick).jobs) < len(section(full).jobs)
