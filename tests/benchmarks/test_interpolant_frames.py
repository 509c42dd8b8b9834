"""The measurement of interpolant frames, as small as it gets."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.interpolant_frames import grid_mesh, measure_interpolant_frames, section, tabulate
from benchmarks.plan import Options
from solver.document.samples import load_sample
from solver.geometry.surfaces import flatten


def test_frames_are_measured() -> None:
    figures = measure_interpolant_frames("cornell", 500, 0.01)
    assert figures.triangles == pytest.approx(500, rel=0.2)
    rates = (figures.interpolant, figures.new_light, figures.four_samples, figures.gouraud, figures.identity)
    assert min(rates) > 0.0
    table = tabulate([figures])
    assert len(table.rows) == 1
    assert all(len(row.cells) == len(table.columns) for row in table.rows)
    assert [target.what for target in table.targets] == ["frames"]


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_grids_cover_the_scene(name: str) -> None:
    surfaces = flatten(load_sample(name))
    mesh = grid_mesh(surfaces, 3000)
    assert len(mesh.triangles) == pytest.approx(3000, rel=0.2)
    a, b, c = (mesh.position[mesh.triangles[:, k]] for k in range(3))
    area = 0.5 * surfaces.size**2 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    by_patch = np.bincount(mesh.patch[mesh.triangles[:, 0]], weights=area, minlength=surfaces.patch_count)
    np.testing.assert_allclose(by_patch, surfaces.area, rtol=1e-4)


def test_quick_runs_leave_the_largest_out() -> None:
    whole = section(Options(scenes=("cornell", "office", "robot_cell")))
    quick = section(Options(scenes=("cornell",), quick=True))
    assert (len(whole.jobs), len(quick.jobs)) == (6, 2)
