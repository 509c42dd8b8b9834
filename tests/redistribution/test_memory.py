"""Scenes that are as they were before have the light that they had, to the last bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.status import SessionState
from solver.illumination.settings import LightSettings
from solver.redistribution.memory import COUNT, Memory
from solver.transport.settings import SolverSettings
from tests.engine.acting import edits, settle
from tests.redistribution.rooms import crate, fresh, room, settled

CRATE = {
    "id": "added",
    "mesh": {"vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "faces": [[0, 1, 2, 3]]},
    "transform": {"translation": [1.0, 1.0, 0.7]},
}


def remembered(memory: Memory, *scenes_and_settings: tuple[object, SolverSettings]) -> None:
    for scene, by in scenes_and_settings:
        for _ in memory.remember(settled(fresh(scene, by))):  # type: ignore[arg-type]
            pass


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    return Drawing()


@pytest.mark.parametrize(
    "there_and_back",
    [
        [[{"op": "add", "object": CRATE}], [{"op": "remove", "id": "added"}]],
        [
            [{"op": "move", "id": "a", "transform": {"translation": [2.0, 1.0, 0.1]}}],
            [{"op": "move", "id": "a", "transform": {"translation": [0.5, 1.0, 0.2]}}],
        ],
        [[{"op": "remove", "id": "a"}], None],
    ],
    ids=["added and removed", "moved and returned", "removed and undone"],
)
def test_there_and_back(drawing: Drawing, there_and_back: list[list[dict[str, object]] | None]) -> None:
    engine = Engine(
        room().with_object(crate("a", (0.5, 1.0, 0.2))), LightSettings(error_tolerance=0.05), drawing=drawing
    )
    settle(engine)
    before, statistics = engine._solution.field(), engine.status().statistics
    for batch in there_and_back:
        if batch is None:
            engine.undo()
        else:
            engine.apply(edits(*batch))
        settle(engine)
    after = engine._solution.field()
    scale = np.abs(before.radiosity).max()
    np.testing.assert_allclose(after.radiosity, before.radiosity, atol=1e-6 * scale)
    now = engine.status().statistics
    assert (now.elements, now.links) == (statistics.elements, statistics.links)
    assert now.memory_bytes == pytest.approx(statistics.memory_bytes, rel=0.05)
    assert engine.status().state is SessionState.CONVERGED
    assert {entry.state.value for entry in engine.log()} == {"settled"}


def test_only_the_same_scene_and_settings_are_recalled() -> None:
    memory, by = Memory(), SolverSettings(error_tolerance=0.1)
    remembered(memory, (room(), by))
    scene = fresh(room(), by)
    other = fresh(room(0.4), by)
    assert memory.recall(other.surfaces, other._rays, by) is None
    assert memory.recall(scene.surfaces, scene._rays, replace(by, error_tolerance=0.05)) is None
    assert memory.recall(scene.surfaces, scene._rays, by) is not None
    assert memory.recall(scene.surfaces, scene._rays, by) is None, "it is in use now"


def test_the_oldest_give_way() -> None:
    by = SolverSettings(error_tolerance=0.1)
    size = settled(fresh(room(), by)).state.nbytes
    memory = Memory(int(2.5 * size))
    rooms = [room(0.3 + 0.1 * k) for k in range(3)]
    remembered(memory, *((each, by) for each in rooms))
    assert 0 < memory.nbytes <= 2.5 * size
    solvers = [fresh(each, by) for each in rooms]
    known = [memory.recall(each.surfaces, each._rays, by) is not None for each in solvers]
    assert known == [False, True, True]


def test_what_is_not_settled_or_too_large_is_not_kept() -> None:
    memory = Memory(1000)
    remembered(memory, (room(), SolverSettings(error_tolerance=0.1)))
    assert memory.nbytes == 0
    memory = Memory()
    for _ in memory.remember(fresh(room())):
        pass
    assert memory.nbytes == 0


def test_only_so_many_are_kept() -> None:
    by = SolverSettings(error_tolerance=0.2)
    memory = Memory()
    remembered(memory, *((room(0.1 + 0.05 * k), by) for k in range(COUNT + 2)))
    assert len(memory._kept) == COUNT
