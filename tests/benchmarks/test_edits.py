"""Edits are measured: what errors are told on, and the sections as small as they get."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import drags, edits
from benchmarks.edit_cases import EDITS, Edit
from benchmarks.edit_curves import Curve, Sample, Work
from benchmarks.edit_error import EditError, EditWitness
from benchmarks.edit_figures import plot_edits
from benchmarks.edits import Depth
from benchmarks.plan import Options
from solver.document.samples import load_sample
from solver.engine.requests import CameraChoice
from solver.engine.world import World
from solver.geometry.scene import Scene
from solver.transport.solve import RadiositySolver
from solver.types import LUMINANCE_WEIGHTS
from tests.redistribution.rooms import SETTINGS, crate, fresh, placed, room, settled

SMALL = Depth(mesh=0.2, reference=0.05, shooting=0.05, times=1, tolerance=0.1)
CUBE = Edit("cube_room", "cube", (-0.5, 0.0, 0.0))


def solved(scene: Scene, tolerance: float) -> RadiositySolver:
    return settled(fresh(scene, replace(SETTINGS, error_tolerance=tolerance)))


def reflected(solver: RadiositySolver) -> float:
    """W of luminance that all leaves reflect."""
    field = solver.field()
    emission = solver.surfaces.emission[field.patch]
    return float(field.area @ ((field.radiosity - emission) @ LUMINANCE_WEIGHTS))


@pytest.mark.parametrize("mesh", [0.02, 0.2], ids=["finer", "coarser"])
def test_elements_have_the_means_of_solutions_of_other_meshes(mesh: float) -> None:
    scene = room((0.7, 0.5, 0.3)).with_object(crate("a", (1.0, 1.0, 0.3)))
    solver, tree = solved(scene, 0.05), solved(scene, mesh).state.tree
    assert (len(tree) > len(solver.state.tree)) == (mesh < 0.05)
    witness = EditWitness(World.of(scene), tree, solver.state)
    luminance = witness.luminances(solver.state)
    assert tree.area[witness.leaves] @ luminance == pytest.approx(reflected(solver), rel=1e-3)


def test_errors_are_told_of_what_is_reflected() -> None:
    scene = room()
    solver = solved(scene, 0.05)
    witness = EditWitness(World.of(scene), solver.state.tree, solver.state)
    luminance = witness.luminances(solver.state)
    most = np.zeros(len(luminance), dtype=np.bool_)
    most[np.argmax(luminance)] = True
    assert witness.error(luminance, most) == EditError(0.0, 0.0)
    off = witness.error(1.1 * luminance, most)
    assert (off.everywhere, off.where_most) == pytest.approx((0.1, 0.1))
    assert witness.error(0.5 * luminance, most, 0.5 * luminance) == EditError(0.0, 0.0)
    assert witness.error(0.0 * luminance, most) == EditError(1.0, 1.0)


def test_what_comes_or_is_shaded_changes_most() -> None:
    scene = room().with_object(crate("a", (1.8, 1.2, 1.8), 0.5))
    after, before = solved(scene, 0.05), solved(room(), 0.05)
    witness = EditWitness(World.of(scene), after.state.tree, after.state)
    most = witness.most_changed(World.of(room()), before.state)
    assert most.sum() == max(1, round(0.01 * len(most)))
    tree = after.state.tree
    owners = {after.surfaces.object_ids[k] for k in after.surfaces.object[tree.patch[witness.leaves[most]]]}
    assert owners == {"a"}, "right below the lamp"


def test_an_object_that_moves_is_told_against_itself() -> None:
    """In a room that is lit alike everywhere nothing changes when a crate moves."""
    walls = room(0.5, 0.0).object("walls")
    bright = replace(walls, material=replace(walls.material, emission=np.full(3, 1.0)))
    glow = crate("a", (1.0, 1.0, 0.3), reflectance=0.5)
    glow = replace(glow, material=replace(glow.material, emission=np.full(3, 1.0)))
    before = Scene(objects={"walls": bright, "a": glow})
    after = before.with_replaced(replace(glow, transform=placed((2.2, 1.6, 1.1))))
    solver, earlier = solved(after, 0.02), solved(before, 0.02)
    witness = EditWitness(World.of(after), solver.state.tree, solver.state)
    found = witness.luminances(solver.state)
    then = witness._luminances_before(World.of(before), earlier.state)
    np.testing.assert_allclose(then, found, rtol=0.05)


def test_curves_tell_when_an_error_is_reached_for_good() -> None:
    errors = (0.9, 0.1, 0.3, 0.15, 0.02)
    samples = (
        Sample(Work(float(k), float(k), 0, k, k, k), EditError(0.5 * e, e), EditError(e, e))
        for k, e in enumerate(errors)
    )
    curve = Curve("any", tuple(samples))
    assert curve.until(0.2) == 3.0
    assert curve.until(1.0) == 0.0
    assert curve.until(0.01) == float("inf")
    assert curve.after(2.5).error.where_most == 0.3
    assert curve.after(-1.0).error.where_most == 0.9


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: f"{edit.scene}, {edit.label}")
def test_edits_lead_to_the_samples(edit: Edit) -> None:
    after = load_sample(edit.scene)
    before = edit.before(after)
    if edit.shift is None:
        assert edit.object not in before.objects
    else:
        moved = after.object(edit.object).world_vertices - before.object(edit.object).world_vertices
        np.testing.assert_allclose(moved, np.broadcast_to(edit.shift, moved.shape), atol=1e-12)


def test_edits_are_measured(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    figures = edits.measure_edits((EDITS[0], CUBE), SMALL)
    assert [one.edit for one in figures.edits] == [EDITS[0], CUBE]
    for one in figures.edits:
        assert [curve.method for curve in one.curves] == [
            "redistribute_first",
            "by_energy",
            edits.FRESH,
            edits.SHOOTING,
        ]
        assert one.redistribution.looks > 0 and one.anew.looks == 0
        assert one.changed == max(1, round(0.01 * one.elements))
        for curve in one.curves:
            first, last = curve.samples[0], curve.samples[-1]
            assert last.to_come == EditError(0.0, 0.0)
            # An edit that changes less than the solution errs by is not told from it.
            assert last.error.where_most < max(first.error.where_most, SMALL.tolerance)
            assert 0.0 < first.work.cpu < last.work.cpu
        shot = one.curves[-1].samples
        assert shot[0].error == EditError(1.0, 1.0), "nothing is lit"
        assert shot[-1].work.shots > 0
    table = edits.tabulate([figures])
    assert len(table.rows) == 8
    assert all(len(row.cells) == len(table.columns) for row in table.rows)
    assert len(table.targets) == 4
    plot_edits([figures], tmp_path)
    assert sorted(file.name for file in tmp_path.iterdir()) == [
        "cube_room_add_cube_10.png",
        "cube_room_move_cube_by_0.5_m_10.png",
    ]


def test_drags_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drags, "_REQUEST", replace(drags._REQUEST, camera=CameraChoice(width=64, height=48)))
    figures = drags.measure_drag(CUBE, SMALL, 6)
    assert 0.0 < figures.applied < figures.first <= figures.shadow < 5.0
    assert figures.drag.frames >= figures.drag.taken > 0
    assert 0.0 < figures.drag.applied < figures.drag.longest
    table = drags.tabulate([figures])
    assert len(table.rows) == 1
    assert len(table.rows[0].cells) == len(table.columns)
    assert [target.what for target in table.targets] == ["first frame", "shadow", "dragged"]
    assert drags.tabulate([replace(figures, elements=40_000)]).targets == (), "those of a coarser mesh"


def test_sections_hold_the_scenes_that_are_edited() -> None:
    whole, quick = Options(), Options(("cornell", "cube_room"), quick=True)
    assert [job.label for job in edits.section(whole).jobs] == [
        "cube_room",
        "robot_cell",
        "robot_cell, 3.3 %",
    ]
    assert [job.label for job in edits.section(quick).jobs] == ["cube_room"]
    assert len(drags.section(whole).jobs) == 6, "three edits at two tolerances"
    assert [job.label for job in drags.section(quick).jobs] == [
        "cube_room, move cube by 0.5 m, 4.0 %",
        "cube_room, move cube by 0.5 m, 2.0 %",
    ]
