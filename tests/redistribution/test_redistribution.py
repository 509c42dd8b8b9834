"""Starting from the solution of an earlier revision: quicker to begin with, and no different at the end."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.world import World
from solver.geometry.scene import Mesh, SceneObject
from solver.redistribution.redistribution import Redistribution
from solver.transport.field import SolveOutcome
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray
from tests.pathtracing.worlds import CUBE, OUTWARD, material
from tests.transport.solving import DEFAULT, finish, lit_cube, shelf, solved, solver_of


def warm(after: World, before: RadiositySolver) -> RadiositySolver:
    return Redistribution(after.surfaces, after.rays, DEFAULT, before)


def patch_means(solver: RadiositySolver) -> FloatArray:
    """(p, 3) mean radiosity of every patch."""
    field = solver.field()
    flux = np.zeros((solver.surfaces.patch_count, 3))
    np.add.at(flux, field.patch, field.radiosity * field.area[:, None])
    return np.asarray(flux / solver.surfaces.area[:, None])


def assert_same_light(one: RadiositySolver, other: RadiositySolver) -> None:
    a, b = patch_means(one), patch_means(other)
    area = one.surfaces.area[:, None]
    off = np.sqrt((area * (a - b) ** 2).sum() / (area * b**2).sum())
    assert off <= np.hypot(one.error_estimate, other.error_estimate)


def with_block(of: World) -> World:
    block = SceneObject("block", Mesh(0.25 + 0.2 * CUBE, OUTWARD), material(0.5))
    return World.of(of.scene.with_object(block))


def test_begins_with_the_means_of_what_was() -> None:
    before = solved(lit_cube())
    after = warm(with_block(lit_cube()), before)
    np.testing.assert_allclose(patch_means(after)[:6], patch_means(before), rtol=1e-9)
    assert after.version == 0
    assert after.outcome is SolveOutcome.RUNNING


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (lit_cube(), with_block(lit_cube())),
        (with_block(lit_cube()), lit_cube()),
        (lit_cube(), lit_cube(0.8)),
        (lit_cube(), lit_cube((0.8, 0.5, 0.2), (1.0, 2.0, 3.0))),
        (lit_cube((0.8, 0.5, 0.2)), lit_cube()),
        (lit_cube(0.5, 0.0), lit_cube()),
        (lit_cube(), World.of(lit_cube().scene.without_object("face3"))),
    ],
    ids=["added", "removed", "repainted", "grey to colour", "colour to grey", "light on", "opened"],
)
def test_ends_where_a_fresh_solve_does(before: World, after: World) -> None:
    continued, fresh = finish(warm(after, solved(before))), solved(after)
    assert continued.outcome is SolveOutcome.CONVERGED
    assert_same_light(continued, fresh)


def test_light_that_goes_out_is_gone() -> None:
    dark = finish(warm(lit_cube(0.5, 0.0), solved(lit_cube())))
    assert dark.outcome is SolveOutcome.CONVERGED
    assert dark.field().radiosity.max() < 1e-6


def test_unfinished_solves_hand_on_what_they_have() -> None:
    begun = solver_of(shelf())
    for _ in range(5):
        begun.step(0.0)
    continued = finish(warm(shelf(), begun))
    assert continued.outcome is SolveOutcome.CONVERGED
    assert_same_light(continued, solved(shelf()))


def test_nothing_in_common() -> None:
    other = World.of(shelf().scene.without_object("board"))
    renamed = {
        f"new {key}": SceneObject(f"new {key}", o.mesh, o.material) for key, o in other.scene.objects.items()
    }
    scene = World.of(type(other.scene)(objects=renamed))
    assert_same_light(finish(warm(scene, solved(shelf()))), solved(other))
