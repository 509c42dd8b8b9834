"""Edits that hurt: an object through a wall and back, a lamp switched ten thousand times.

Right means: in the end the light is that of a fresh solve, and nothing has grown on the way.
"""

from __future__ import annotations

import time
import tracemalloc
from typing import Any

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.status import ChangeState
from tests.engine.acting import edits
from tests.stability.chain import (
    DARK,
    LONGEST,
    SETTINGS,
    TOLERANCE,
    assert_sound,
    difference,
    irradiance,
    settle,
    solve,
)
from tests.stability.places import BOTH, UP, X, crate, grid, lamp, quad, room, scene


def walled() -> list[Any]:
    """A room with a wall across two thirds of it, and a crate on the lamp's side."""
    wall = quad("wall", [0.0, 0.3, 0.0], 0.66 * X, UP, BOTH)
    return [room(), lamp(), wall, crate("crate", (0.2, 0.5, 0.1), (0.4, 0.7, 0.3))]


def move(engine: Engine, y: float) -> None:
    """Move the crate by y metres from where it was at first."""
    engine.apply(edits({"op": "move", "id": "crate", "transform": {"translation": [0.0, y, 0.0]}}))


def test_through_a_wall_and_back(drawing: Drawing) -> None:
    """Settled, half settled and not at all: within the wall, coplanar with it, and behind it."""
    engine = solve(scene(*walled()), drawing)
    before = irradiance(engine, grid(5), UP)
    for count, y in enumerate([-0.1, -0.2, -0.2 + 1e-9, -0.3, -0.4, -0.45, -0.4, -0.2, -0.1, 0.0]):
        move(engine, y)
        for _ in range(count % 3):
            engine.step(0.0)
        if count % 3 == 2:
            settle(engine)
            assert_sound(engine, frames=False)
    settle(engine)
    assert_sound(engine)
    assert {entry.state for entry in engine.log()} == {ChangeState.SETTLED}
    assert difference(irradiance(engine, grid(5), UP), before) < TOLERANCE


@pytest.mark.parametrize("y", [-0.2, -0.3, -0.45])
def test_in_the_wall_as_if_it_had_been_there_always(y: float, drawing: Drawing) -> None:
    engine = solve(scene(*walled()), drawing)
    move(engine, y)
    settle(engine)
    assert_sound(engine, frames=y == -0.3)
    anew = solve(engine.scene, drawing)
    assert difference(irradiance(engine, grid(5), UP), irradiance(anew, grid(5), UP)) < TOLERANCE


def test_onto_the_floor_and_off_it(drawing: Drawing) -> None:
    """A rug comes to lie in the floor's own plane, which cuts the floor, and goes again."""
    rug = quad("crate", [0.2, 0.2, 0.0], 0.4 * X, [0.0, 0.4, 0.0], BOTH)
    engine = solve(scene(room(), lamp(), rug), drawing)
    lying = irradiance(engine, grid(5, height=1e-6), UP)
    for z in (0.2, 0.0, 1e-7, 0.4, 0.0):
        engine.apply(edits({"op": "move", "id": "crate", "transform": {"translation": [0.0, 0.0, z]}}))
        engine.step(0.0)
    settle(engine)
    assert_sound(engine)
    assert difference(irradiance(engine, grid(5, height=1e-6), UP), lying) < TOLERANCE


def toggle(engine: Engine, times: int) -> None:
    """Switch the lamp off and on; now and then it is waited for."""
    start = time.process_time()
    for count in range(times):
        emission = [10.0] * 3 if count % 2 else [0.0] * 3
        engine.apply(
            edits(
                {
                    "op": "set_material",
                    "id": "lamp",
                    "material": {"reflectance": [0.0] * 3, "emission": emission},
                }
            )
        )
        for _ in range(count % 4):
            engine.step(0.0)
        if count % 50 > 47:
            settle(engine)
    settle(engine)
    assert time.process_time() - start < LONGEST + 0.1 * times


@pytest.mark.parametrize("times", [200, pytest.param(10_000, marks=pytest.mark.slow)])
def test_a_lamp_switched_off_and_on(times: int, drawing: Drawing) -> None:
    engine = solve(scene(room(), lamp(), crate("crate", (0.2, 0.2, 0.0), (0.5, 0.5, 0.5))), drawing)
    before, held = irradiance(engine, grid(5), UP), engine.status().statistics
    toggle(engine, times // 2)
    tracemalloc.start()
    toggle(engine, times // 2)
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert_sound(engine)
    assert {entry.state for entry in engine.log()} == {ChangeState.SETTLED}
    assert engine.revision == 1 + times
    assert difference(irradiance(engine, grid(5), UP), before) < TOLERANCE
    after = engine.status().statistics
    assert after.links < 2 * held.links and after.elements < 2 * held.elements
    assert grown < 1e7 + 2e4 * times, "but for the log and what can be taken back"


def test_dark_is_dark_after_the_lamp(drawing: Drawing) -> None:
    engine = solve(scene(room(0.9), lamp()), drawing, SETTINGS)
    engine.apply(edits({"op": "set_material", "id": "lamp", "material": {"reflectance": [0.0] * 3}}))
    settle(engine)
    assert_sound(engine)
    assert np.max(irradiance(engine, grid(4), UP)) < DARK


def test_everything_goes_and_comes(drawing: Drawing) -> None:
    """Undo of a batch that removed all objects."""
    engine = solve(scene(*walled()), drawing)
    before = irradiance(engine, grid(4), UP)
    engine.apply(edits(*({"op": "remove", "id": name} for name in ("crate", "wall", "lamp", "room"))))
    settle(engine)
    assert_sound(engine)
    assert not irradiance(engine, grid(4), UP).any()
    engine.undo()
    settle(engine)
    assert_sound(engine, frames=False)
    assert difference(irradiance(engine, grid(4), UP), before) < TOLERANCE
