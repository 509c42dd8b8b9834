"""Interpolants in the making: what they start from, how they are built, what outlives a split."""

from __future__ import annotations

import numpy as np
import pytest

from solver.illumination.interpolation.interpolants import Interpolants
from solver.illumination.interpolation.locating import told_at, triangles_at
from solver.illumination.interpolation.refinement import cells_to_split, has_urgent_cells, view_error
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.splitting import split_cells
from solver.illumination.meshing.triangulation import triangulate
from solver.types import FloatArray
from tests.illumination.fine import build_all, interpolants_of, relative_error, triangulated
from tests.transport.solving import furnace, shelf, solved

SHELF = solved(shelf(), 0.05)


def test_before_any_sample_is_computed_the_solution_shows() -> None:
    interpolants = interpolants_of(SHELF)
    mesh = interpolants.mesh()
    assert not mesh.is_fine.any()
    middle = mesh.coefficients @ np.ones(3) / 3.0
    value = (
        middle[:, 0] / 9
        + middle[:, 1] / 9
        + middle[:, 2] / 3
        + middle[:, 3] / 9
        + middle[:, 4] / 3
        + middle[:, 5]
    )
    field = SHELF.field()
    bright = (field.irradiance.mean(axis=1))[mesh.leaf]
    assert abs(np.average(value - bright, weights=interpolants.area)) < 0.02 * bright.mean()


def test_samples_become_point_irradiances() -> None:
    interpolants = build_all(interpolants_of(SHELF))
    assert interpolants.is_fine.all() and interpolants.is_checked.all()
    position, value, exact = interpolants.sample_points()
    assert exact.all()
    owner = np.empty(len(position), dtype=np.int64)
    owner[interpolants.nodes.ravel()] = np.repeat(np.arange(len(interpolants.nodes)), 6)
    few = np.random.default_rng(1).choice(len(position), 50, replace=False)
    leaves = SHELF.state.tree.leaves
    again = interpolants._point.at(position[few], leaves[interpolants.triangulation.leaf[owner[few]]])
    np.testing.assert_allclose(value[few], again, rtol=1e-9)


def test_what_is_wanted_comes_first_and_nothing_else_is_built() -> None:
    interpolants = interpolants_of(SHELF)
    pixels = np.zeros(len(interpolants.triangulation.triangles))
    pixels[7:13] = 5.0
    interpolants.want(pixels)
    while interpolants.step():
        pass
    assert interpolants.is_checked[7:13].all() and interpolants.is_checked.sum() == 6
    assert interpolants.is_fine[7:13].all() and not interpolants.is_fine.all()
    assert interpolants.evaluations <= 6 * 7


def test_constant_light_is_exact() -> None:
    interpolants = build_all(interpolants_of(solved(furnace(0.5), 0.05)))
    assert relative_error(interpolants) < 2e-3
    np.testing.assert_allclose(interpolants.mean_luminance(), 2.0, rtol=0.02)


def test_splitting_lowers_the_error_and_keeps_what_was_sampled() -> None:
    solver = SHELF
    coarse = build_all(interpolants_of(solver))
    pixels = np.full(len(coarse.triangulation.triangles), 100.0)
    before = view_error(coarse, pixels)
    assert before.share_known == 1.0
    chosen = cells_to_split(coarse, pixels, 0.5 * before.relative)
    assert 0 < chosen.sum() < len(chosen)
    cells = split_cells(Cells.of(solver.field()), chosen)
    mesh = triangulate(cells, solver.surfaces, ConstraintEdges.none(), coarse.triangulation)
    fine = Interpolants(
        coarse._point, solver.state.tree.leaves, cells, mesh, solver.field().irradiance, coarse
    )
    assert 0 < fine.is_fine.sum() < len(fine.is_fine), "unsplit cells keep their samples"
    assert relative_error(fine) < 1.1 * relative_error(coarse), "what was known between samples still shows"
    told = view_error(fine, fine.area)
    assert told.share_known < 1.0
    assert told.relative == pytest.approx(view_error(coarse, coarse.area).relative, rel=0.1)
    build_all(fine)
    assert fine.evaluations < len(fine.sample_points()[0])
    assert relative_error(fine) < 0.8 * relative_error(coarse)


def test_nothing_is_split_within_the_tolerance_or_for_less_than_a_few_pixels() -> None:
    interpolants = build_all(interpolants_of(SHELF))
    pixels = np.full(len(interpolants.triangulation.triangles), 100.0)
    assert not cells_to_split(interpolants, pixels, 1.0).any()
    assert not cells_to_split(interpolants, 1e-3 * pixels, 1e-4).any()
    assert not cells_to_split(interpolants, 0.0 * pixels, 1e-4).any()
    assert cells_to_split(interpolants, pixels, 1e-4).any()


def test_few_cells_that_are_most_of_the_error_are_split_before_all_is_known() -> None:
    interpolants = interpolants_of(SHELF)
    pixels = np.full(len(interpolants.triangulation.triangles), 100.0)
    assert not has_urgent_cells(interpolants, pixels, 1e-3), "nothing is known"
    first = np.zeros_like(pixels)
    first[: len(pixels) // 4] = 1.0
    interpolants.want(first)
    while interpolants.step():
        assert not interpolants.is_between or interpolants.is_checked.any()
    assert interpolants.is_between and not interpolants.is_checked.all()
    known = view_error(interpolants, np.where(interpolants.is_checked, pixels, 0.0)).relative
    assert has_urgent_cells(interpolants, pixels, 0.1 * known)
    assert not has_urgent_cells(interpolants, pixels, 10.0 * known)


def test_places_are_found_in_the_triangles_that_hold_them() -> None:
    mesh = triangulated(SHELF)
    random = np.random.default_rng(3)
    which = random.integers(0, len(mesh.triangles), 200)
    place = random.dirichlet(np.ones(3), 200)
    position = np.einsum("nk,nka->na", place, mesh.position[mesh.triangles[which]])
    triangle, found = triangles_at(mesh, position, mesh.leaf[which])
    np.testing.assert_array_equal(triangle, which)
    np.testing.assert_allclose(found, place[:, 1:], atol=1e-9)
    none, _ = triangles_at(mesh, position[:1], np.array([mesh.leaf.max() + 7], dtype=np.int32))
    assert none.tolist() == [-1]


def test_quadratics_tell_between_samples_what_they_are_made_from() -> None:
    random = np.random.default_rng(4)
    coefficients = random.uniform(0.5, 1.0, (6, 3))

    def quadratic(s: FloatArray, t: FloatArray) -> FloatArray:
        return np.stack([s * s, s * t, s, t * t, t, np.ones_like(s)], axis=1) @ coefficients

    values = quadratic(np.array([0.0, 0.5, 1.0, 0.5, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 0.5, 1.0, 0.5]))
    place = random.dirichlet(np.ones(3), 50)[:, 1:]
    node = np.arange(6, dtype=np.int32)[None]
    told = told_at(node, values, np.zeros(50, dtype=np.int32), place)
    np.testing.assert_allclose(told, quadratic(place[:, 0], place[:, 1]), rtol=1e-5)
    np.testing.assert_array_equal(told_at(node, -values, np.zeros(50, dtype=np.int32), place), 0.0)
