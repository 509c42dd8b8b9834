"""Starting from the solution of an earlier revision: quicker to begin with, and no different at the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.world import World
from solver.geometry.scene import Mesh, Scene, SceneObject
from solver.redistribution.redistribution import Redistribution
from solver.transport.estimate import estimate_error
from solver.transport.field import SolveOutcome
from solver.transport.settings import Interleaving
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray
from tests.pathtracing.worlds import CUBE, OUTWARD, material
from tests.redistribution.rooms import SETTINGS, crate, difference, edited, fresh, placed, room, settled
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


def bytes_of(solver: RadiositySolver) -> tuple[int, int, int]:
    statistics = solver.statistics()
    return statistics.elements, statistics.links, statistics.memory_bytes


def test_sessions_of_many_edits_do_not_fill_up() -> None:
    """Each settled before the next: what the shadows of places long left needed is folded back."""
    random = np.random.default_rng(3)
    scene = room().with_object(crate("a", (1.0, 1.0, 0.3))).with_object(crate("b", (3.0, 2.0, 0.0)))
    solver = settled(fresh(scene))
    for number in range(1, 31):
        at = random.uniform((0.1, 0.1, 0.02), (3.2, 2.2, 1.5))
        scene = scene.with_replaced(replace(scene.object("a"), transform=placed(at)))
        solver = settled(edited(solver, scene, number))
    anew = settled(fresh(scene))
    for now, then in zip(bytes_of(solver), bytes_of(anew), strict=True):
        assert now < 1.6 * then


def test_an_interrupted_first_solve_goes_on() -> None:
    """Pairs that were not linked yet when an edit came are linked by the next revision."""
    scene = room()
    begun = fresh(scene)
    begun.step(0.0)
    assert begun.linked < begun.surfaces.patch_count
    furnished = scene.with_object(crate("a", (1.0, 1.0, 0.0)))
    after = edited(begun, furnished)
    assert difference(settled(after), settled(fresh(furnished))) < 0.05


def test_the_energy_owed_falls_and_the_greatest_goes_first() -> None:
    before = settled(fresh(room()))
    after = edited(before, room().with_object(crate("a", (1.8, 1.2, 0.5))), number=7)
    owed = after.owed()
    assert set(owed) == {7}
    assert owed[7] > 0.0
    left = [owed[7]]
    while after.owes:
        after.step(0.0)
        left.append(after.owed().get(7, 0.0))
    steps = -np.diff(left)
    assert np.all(steps >= -1e-12)
    assert left[-1] == 0.0
    assert after.looks > 0


def test_places_that_a_drag_has_passed_leave_no_debt() -> None:
    """Two hundred moves cost one removal and one addition."""
    scene = room().with_object(crate("a", (1.0, 1.0, 0.3)))
    solver: RadiositySolver = settled(fresh(scene))
    first = None
    for number in range(1, 201):
        at = (0.2 + 0.014 * number, 1.0, 0.3)
        scene = scene.with_replaced(replace(scene.object("a"), transform=placed(at)))
        solver = edited(solver, scene, number, drags=number > 1)
        if first is None:
            first = int(np.count_nonzero(solver.state.links.debt))
    last = int(np.count_nonzero(solver.state.links.debt))
    direct = edited(settled(fresh(room().with_object(crate("a", (1.0, 1.0, 0.3))))), scene, 1)
    assert last == np.count_nonzero(direct.state.links.debt)
    assert difference(settled(solver), settled(fresh(scene))) < 0.05


def test_the_error_is_told_while_light_follows() -> None:
    """A lamp that moves changes everything, and nobody is told that the light is right before it is."""
    before = settled(fresh(room()))
    scene = room()
    moved = scene.with_replaced(replace(scene.object("lamp"), transform=placed((1.2, 0.8, -0.5))))
    truth = settled(fresh(moved))
    after = edited(before, moved)
    assert after.error_estimate == 1.0
    told = []
    while after.step(0.0):
        told.append((after.error_estimate, difference(after, truth)))
    early = told[: len(told) // 3]
    assert all(estimate >= 0.8 * error for estimate, error in early)


@pytest.mark.parametrize("interleaving", Interleaving)
def test_both_orders_of_work_lead_to_the_same_light(interleaving: Interleaving) -> None:
    settings = replace(SETTINGS, interleaving=interleaving)
    scene = room((0.7, 0.5, 0.3)).with_object(crate("a", (1.0, 1.0, 0.3)))
    moved = scene.with_replaced(replace(scene.object("a"), transform=placed((2.2, 1.1, 0.8))))
    after = settled(edited(settled(fresh(scene, settings)), moved))
    assert after.outcome is SolveOutcome.CONVERGED
    assert difference(after, settled(fresh(moved, settings))) < 0.05


def test_a_lamp_that_comes_shoots_first() -> None:
    scene = room()
    lamp = replace(crate("new", (0.5, 0.5, 0.5), 0.1), material=material(0.0, 200.0))
    after = edited(settled(fresh(scene)), scene.with_object(lamp))
    after.owed()
    plan, count = after._plan, after.surfaces.patch_count
    assert plan is not None
    rows = plan.rows
    last_pair = np.flatnonzero(rows < 0).max()
    assert last_pair < len(rows) - 1 or np.all(rows < 0)
    new = after.surfaces.object_ids.index("new")
    ends = np.stack([after.unlinked.p, after.unlinked.q])
    assert np.all((after.surfaces.object[ends] == new).any(axis=0)), "all pairs are the lamp's"
    assert np.all(rows[: len(after.unlinked)] < 0), "and come before all links"
    assert count == scene_patches(scene) + 6


def scene_patches(scene: Scene) -> int:
    return fresh(scene).surfaces.patch_count


@pytest.mark.parametrize("at", [(1.0, 1.0, 0.3), (2.2, 1.4, 0.0), (3.2, 0.4, 1.2)])
def test_the_error_told_after_an_edit_is_that_of_the_light_that_is_there(
    at: tuple[float, float, float],
) -> None:
    """Though it was estimated before the last of the light had arrived: some tolerance's part of all."""
    scene = room().with_object(crate("a", (1.0, 1.4, 0.0)))
    solver = settled(fresh(scene))
    for number, place in enumerate([at, (1.0, 1.4, 0.0), at], 1):
        scene = scene.with_replaced(replace(scene.object("a"), transform=placed(place)))
        solver = settled(edited(solver, scene, number))
        assert solver.error_estimate == pytest.approx(
            estimate_error(solver.state).relative, rel=2.0 * SETTINGS.error_tolerance
        )
