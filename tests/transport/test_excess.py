"""Light that is sent where it cannot arrive: told where a lamp hides what it lights, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.world import World
from solver.transport.excess import excess_light
from solver.transport.field import SolveOutcome
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray
from tests.accuracy.measure import measure
from tests.pathtracing.worlds import material, polygon, square, world
from tests.transport.solving import box, furnace, lit_cube, shelf, solved, solver_of, state_of

CORNERS = [(0.3, 0.7), (0.17, 0.5), (0.61, 0.71)]
"""Where lamps reach from and to, in a room of 1 m"""


def room(gap: float, low: float, high: float, reflectance: float = 0.5, back: bool = False) -> World:
    """A room with a lamp of 10 W/m2 close over its floor, which may have a lit back."""
    lamp = square("lamp", material(0.0, 10.0), gap, down=True, low=low, high=high)
    backs = [square("back", material(0.5), gap + 0.01, low=low, high=high)] if back else []
    return world(box("room", reflectance), lamp, *backs)


def excess_of(solver: RadiositySolver) -> FloatArray:
    """(n,) (W/m2)^2"""
    state = state_of(solver)
    radiosity = np.maximum(state.radiosity[:, 0] @ state.weights, 0.0)
    return excess_light(state.tree, state.links, radiosity)


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-5])
def test_coarse_links_send_light_from_under_a_lamp(gap: float) -> None:
    """Once the lamp knows what it lights, while the walls still have one link each to all of the floor."""
    solver = solver_of(room(gap, 0.3, 0.7))
    most, of_walls = 0.0, 0.0
    while solver.step(1e-4):
        if state_of(solver).gathers:
            excess = excess_of(solver)
            most, of_walls = max(most, excess[0]), max(of_walls, excess[1:6].max())
    # What 0.16 m2 of the floor send of the 5 W/m2 that they have, by a form factor of 1 less what is hidden.
    assert 0.2 < most / (0.16 * 5.0**2) < 1.0
    assert of_walls == 0.0, "what the walls see, they may see"
    assert excess_of(solver)[0] == 0.0


@pytest.mark.parametrize(
    "scene", [lit_cube(), shelf(), shelf(two_sided=True)], ids=["cube", "open", "closed"]
)
def test_there_is_next_to_none_where_nothing_lies_close(scene: World) -> None:
    solver = solved(scene, 0.02)
    state = state_of(solver)
    patches = slice(0, state.tree.patch_count)
    radiosity = state.radiosity[state.tree.leaves, 0] @ state.weights
    power = state.tree.area[state.tree.leaves] @ radiosity**2
    assert state.tree.area[patches] @ excess_of(solver)[patches] < 1e-4 * power


def test_rays_that_all_arrive_see_no_excess() -> None:
    """A closed room whose sums are right, but for the noise that is told, has none."""
    solver = solved(furnace(0.5), 0.05)
    assert excess_of(solver).max() < 0.02 * float(np.max(solver.field().radiosity)) ** 2


@pytest.mark.parametrize("back", [False, True], ids=["lamp", "lamp with a back"])
@pytest.mark.parametrize(("low", "high"), CORNERS)
@pytest.mark.parametrize("gap", [3e-2, 1e-2, 1e-3, 1e-5])
def test_errors_are_told_and_energy_kept(gap: float, low: float, high: float, back: bool) -> None:
    """Where the floor is lit it is hidden: the least alike that light and visibility can be."""
    scene = room(gap, low, high, back=back)
    solver = solved(scene, 0.05)
    assert measure(scene, solver, 100_000).error <= solver.error_estimate <= 0.05
    field = solver.field()
    kept = (1.0 - scene.surfaces.reflectance[field.patch, 0]) * field.irradiance[:, 0]
    assert field.area @ kept <= 1.05 * 10.0 * (high - low) ** 2


def test_a_gap_that_rays_do_not_see_is_not_split_for_ever() -> None:
    assert solved(room(1e-7, 0.3, 0.7), 0.05).statistics().links < 20_000


def test_sums_that_only_scatter_are_not_refined_for_ever() -> None:
    """A thin screen hides a lamp from parts of a closed room: its leaves see a little too much or little."""
    lamp = polygon("lamp", [[0.4, 0.4, 0.9], [0.4, 0.6, 0.9], [0.6, 0.6, 0.9]], material(0.0, 10.0))
    upright = [[0.3, 0.5, 0.1], [0.7, 0.5, 0.1], [0.7, 0.5, 0.6], [0.3, 0.5, 0.6]]
    screen = polygon("screen", upright, material(0.5, two_sided=True))
    outline = [[0.1, 0.1, 0.3], [0.5, 0.1, 0.3], [0.5, 0.2, 0.3], [0.2, 0.2, 0.3], [0.1, 0.4, 0.3]]
    table = polygon("table", outline, material(0.5))
    solver = solved(world(box("room", 0.5), lamp, screen, table), 0.03)
    assert solver.outcome is SolveOutcome.CONVERGED
    assert solver.statistics().links < 50_000
