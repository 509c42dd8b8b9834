"""Long sessions: nothing that an edit owes is lost, whatever interrupts it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.status import ChangeState, SessionState
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS
from tests.engine.acting import edits, settle
from tests.redistribution.rooms import crate, room

TOLERANCE = 0.05
NAMES = ("a", "b", "c")


def random_edit(engine: Engine, random: np.random.Generator) -> dict[str, Any] | None:
    """Of furniture, lamp or walls; None: undo."""
    name = str(random.choice(NAMES))
    at = random.uniform((0.1, 0.1, 0.02), (3.0, 2.0, 1.4)).tolist()
    kind = random.integers(0, 10)
    if kind == 0:
        return None
    if kind == 1:
        grey = float(random.uniform(0.2, 0.7))
        return {"op": "set_material", "id": "walls", "material": {"reflectance": [grey] * 3}}
    if kind == 2:
        watts = float(random.uniform(2.0, 20.0))
        return {"op": "set_material", "id": "lamp", "material": {"emission": [watts] * 3}}
    if name not in engine.scene.objects:
        size = float(random.uniform(0.2, 0.6))
        box = crate(name, (0.0, 0.0, 0.0), size)
        mesh = {"vertices": box.mesh.vertices.tolist(), "faces": [list(face) for face in box.mesh.faces]}
        made = {"id": name, "mesh": mesh, "transform": {"translation": at}}
        return {"op": "add", "object": made}
    if kind < 5:
        return {"op": "remove", "id": name}
    return {"op": "move", "id": name, "transform": {"translation": at}}


def edit_at_random(drawing: Drawing, count: int, seed: int) -> Engine:
    """A session of `count` edits, three in ten of which interrupt the one before."""
    random = np.random.default_rng(seed)
    engine = Engine(room(), LightSettings(error_tolerance=TOLERANCE), drawing=drawing)
    done = 0
    while done < count:
        edit = random_edit(engine, random)
        if edit is not None:
            engine.apply(edits(edit))
        elif engine.revision > 1 and engine._history._past:
            engine.undo()
        else:
            continue
        done += 1
        if random.random() < 0.3:
            for _ in range(int(random.integers(0, 6))):
                engine.step(0.0)
        else:
            settle(engine)
    settle(engine)
    return engine


def assert_nothing_is_lost(engine: Engine, drawing: Drawing) -> None:
    assert engine.status().state is SessionState.CONVERGED
    log = engine.log()
    assert {entry.state for entry in log} == {ChangeState.SETTLED}
    assert {entry.energy_to_redistribute for entry in log} == {0.0}
    field, surfaces = engine._solution.field(), engine._world.surfaces
    emitted = surfaces.area @ (surfaces.emission @ LUMINANCE_WEIGHTS)
    absorbed = field.area @ (
        (field.irradiance * (1.0 - surfaces.reflectance[field.patch])) @ LUMINANCE_WEIGHTS
    )
    assert absorbed == pytest.approx(emitted, rel=TOLERANCE)
    anew = Engine(engine.scene, engine.settings, drawing=drawing)
    settle(anew)
    random = np.random.default_rng(1)
    floor = random.uniform((0.05, 0.05, 0.0), (3.95, 2.95, 0.0), (400, 3))
    up = np.tile([0.0, 0.0, 1.0], (len(floor), 1))
    found, expected = (each.probe(floor, up).irradiance @ LUMINANCE_WEIGHTS for each in (engine, anew))
    off = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
    assert off < TOLERANCE, "no stale light where something was"


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    return Drawing()


def test_many_edits(drawing: Drawing) -> None:
    assert_nothing_is_lost(edit_at_random(drawing, 60, 1), drawing)


@pytest.mark.slow
def test_a_thousand_edits(drawing: Drawing) -> None:
    engine = edit_at_random(drawing, 1000, 2)
    assert len({entry.entry for entry in engine.log()}) > 500
    assert_nothing_is_lost(engine, drawing)
