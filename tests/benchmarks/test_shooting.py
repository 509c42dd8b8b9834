"""Progressive refinement by shooting: it comes to the solution of its own matrix, and makes no light."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.shooting import Shooting
from solver.engine.world import World
from solver.transport.elements import ElementTree
from solver.types import LUMINANCE_WEIGHTS
from tests.transport.solving import furnace, lit_cube, shelf


def shooting_in(world: World, splits: int = 1) -> Shooting:
    """Every patch split so often."""
    tree = ElementTree(world.surfaces)
    for _ in range(splits):
        tree.split(tree.leaves)
    return Shooting(world.surfaces, world.rays, tree)


@pytest.mark.parametrize(
    "world", [shelf(), lit_cube((0.8, 0.5, 0.2), (1.0, 2.0, 3.0))], ids=["shelf", "colour"]
)
def test_it_agrees_with_a_dense_solve_of_the_same_matrix(world: World) -> None:
    shooting = shooting_in(world)
    n = len(shooting.area)
    matrix = np.stack([shooting.form_factors(k) for k in range(n)], axis=1)
    emitted = float(shooting.unshot.sum())
    while shooting.unshot.sum() > 1e-12 * emitted:
        shooting.shoot()
    for channel in range(3):
        reflectance = shooting.reflectance[:, channel, None]
        exact = np.linalg.solve(np.eye(n) - reflectance * matrix, shooting.emission[:, channel])
        np.testing.assert_allclose(shooting.radiosity[:, channel], exact, rtol=1e-10)


def test_what_an_element_sees_is_a_hemisphere_at_most() -> None:
    shooting = shooting_in(furnace(0.5), 2)
    matrix = np.stack([shooting.form_factors(k) for k in range(len(shooting.area))], axis=1)
    sums = matrix.sum(axis=1)
    # In a closed room it is all of it, but for shadows that few rays tell.
    assert sums.mean() == pytest.approx(1.0, abs=0.02)
    assert np.all(np.diag(matrix) == 0.0)
    empty = shooting_in(lit_cube(), 2)
    matrix = np.stack([empty.form_factors(k) for k in range(len(empty.area))], axis=1)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)


def test_the_element_with_the_most_energy_shoots_first() -> None:
    shooting = shooting_in(lit_cube(0.5), 1)
    greatest = int(np.argmax(shooting.unshot))
    before = shooting.unshot[greatest]
    shooting.shoot()
    assert shooting.shots == 1
    assert shooting.ray_count > 0
    assert shooting.unshot[greatest] == 0.0
    # Half of what was shot arrives and is left over; its formula holds at the middles of elements.
    reflected = shooting.area @ ((shooting.radiosity - shooting.emission) @ LUMINANCE_WEIGHTS)
    assert reflected == pytest.approx(0.5 * before, rel=0.1)
