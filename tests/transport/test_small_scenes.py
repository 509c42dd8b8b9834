"""Scenes with nothing, or next to nothing, to solve; and that slicing the work does not matter."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.world import World
from solver.transport.field import SolveOutcome
from tests.pathtracing.worlds import material, polygon, square, world
from tests.transport.solving import irradiance_at, lit_cube, shelf, solved, solver_of

FLOOR = square("floor", material(0.5, 1.0), z=0.0)


@pytest.mark.parametrize(
    ("scene", "leaves", "brightest"),
    [
        (world(), 0, 0.0),
        (world(FLOOR), 1, 1.0),
        (world(FLOOR, square("back", material(0.5), z=1.0)), 2, 1.0),
        (world(FLOOR, square("beside", material(0.5), z=0.0, low=1.0, high=2.0)), 2, 1.0),
        (world(square("two", material(0.5, 2.0, two_sided=True), z=0.0)), 2, 2.0),
        (lit_cube(0.5, 0.0), 6, 0.0),
        (lit_cube(0.0, 3.0), 6, 3.0),
    ],
    ids=["nothing", "one face", "facing away", "side by side", "two-sided", "no light", "no reflection"],
)
def test_nothing_to_solve(scene: World, leaves: int, brightest: float) -> None:
    solver = solved(scene)
    assert solver.outcome is SolveOutcome.CONVERGED
    assert solver.error_estimate == 0.0
    assert solver.unshot_fraction == 0.0
    assert solver.progress == 1.0
    field = solver.field()
    assert len(field.area) == leaves
    np.testing.assert_array_equal(
        field.radiosity, np.clip(scene.surfaces.emission[field.patch], 0, brightest)
    )
    assert solver.statistics().leaves == leaves
    assert not irradiance_at(solver, np.array([[0.5, 0.5, 5.0]]), np.array([[0.0, 0.0, 1.0]])).any()


def test_two_faces_know_each_other() -> None:
    """Two parallel squares: the answer of two unknowns, were they constant, is close."""
    f = 0.199824895698387
    scene = world(FLOOR, square("roof", material(0.5), z=1.0, down=True))
    field = solved(scene, 0.005).field()
    means = [
        np.average(field.radiosity[field.patch == k, 0], weights=field.area[field.patch == k]) for k in (0, 1)
    ]
    assert means[1] == pytest.approx(0.5 * f / (1.0 - 0.25 * f * f), rel=5e-3)
    assert means[0] == pytest.approx(1.0 / (1.0 - 0.25 * f * f), rel=1e-3)


def test_a_sliver_and_a_speck() -> None:
    """1 : 10^4 in length and area to area 1 : 10^8: solved like all else."""
    sliver = polygon("sliver", [[0, 0, 1], [0, 1e-4, 1], [1, 1e-4, 1], [1, 0, 1]], material(0.5, 1e3))
    speck = polygon(
        "speck", 1e-4 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]) + [0.5, 0.5, 0.5], material(0.5)
    )
    solver = solved(world(square("floor", material(0.5), z=0.0), sliver, speck))
    assert solver.outcome is SolveOutcome.CONVERGED
    field = solver.field()
    assert np.all(np.isfinite(field.radiosity))
    assert field.irradiance[field.patch == 2].min() > 0.0


def test_slices_do_not_matter() -> None:
    whole, sliced = solved(shelf()), solver_of(shelf())
    steps = 1
    versions = []
    while sliced.step(0.0):
        steps += 1
        versions.append(sliced.version)
        assert 0.0 <= sliced.progress <= 1.0
    assert steps > 50
    assert versions == sorted(versions)
    a, b = whole.field(), sliced.field()
    means = [np.bincount(f.patch, f.area * f.radiosity[:, 0]) / np.bincount(f.patch, f.area) for f in (a, b)]
    np.testing.assert_allclose(means[0], means[1], rtol=2e-3)


def test_the_field_is_there_from_the_start() -> None:
    """Before any light has moved: emission, and the ambient term."""
    field = solver_of(lit_cube(0.5, 1.0)).field()
    assert len(field.area) == 6
    np.testing.assert_allclose(field.irradiance, 1.0 / 6.0 / 0.5)
    np.testing.assert_allclose(field.radiosity[:, 0], np.where(field.patch == 1, 1.0, 0.0) + 0.5 / 3.0)
