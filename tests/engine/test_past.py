"""An engine that goes on from a past stands where the one stood that ended, but for its light."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.document.edits import apply_edits
from solver.document.limits import SceneLimits
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.history import History, NothingToReverseError, step_of
from solver.engine.past import Past
from solver.engine.status import ChangeState
from solver.errors import LimitExceededError, SceneError
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from tests.engine.acting import edits, settle
from tests.engine.scenes import box

LOOSE = LightSettings(error_tolerance=0.05)


def move(x: float) -> dict[str, Any]:
    return {"op": "move", "id": "crate", "transform": {"translation": [x, 0.5, 0.5]}}


def paint(grey: float) -> dict[str, Any]:
    return {"op": "set_material", "id": "floor", "material": {"reflectance": [grey] * 3}}


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    return Drawing()


def told(engine: Engine) -> list[tuple[int, int, str, str]]:
    return [(entry.entry, entry.revision, entry.op, entry.id) for entry in engine.log()]


def floor_of(scene: Scene) -> float:
    return float(scene.object("floor").material.reflectance[0])


def test_it_stands_where_the_other_stood(drawing: Drawing) -> None:
    lived = Engine(box(), LOOSE, drawing=drawing)
    batches = [edits(paint(0.1 * number)) for number in range(1, 5)] + [edits(move(0.1)), edits(move(0.2))]
    for batch in batches:
        lived.apply(batch)
    lived.undo()
    lived.undo()
    log = lived.log()
    past = Past(
        scene=box(),
        batches=tuple(map(tuple, batches[:4])),
        undone=(tuple(batches[5]), tuple(batches[4])),
        revision=lived.revision,
        entries=tuple(log),
        count=8,
        drags=True,
    )
    risen = Engine(past, LOOSE, drawing=drawing)
    assert risen.revision == lived.revision == 9
    assert told(risen) == told(lived)
    for act in ("undo", "redo", "redo", "redo"):
        getattr(lived, act)()
        getattr(risen, act)()
        assert floor_of(risen.scene) == floor_of(lived.scene)
        placed = [engine.scene.object("crate").transform.matrix.tolist() for engine in (risen, lived)]
        assert placed[0] == placed[1]
        assert told(risen) == told(lived)
    with pytest.raises(NothingToReverseError):
        risen.redo()
    settle(risen)
    assert all(entry.state is ChangeState.SETTLED for entry in risen.log())


def test_a_past_that_cannot_have_been_is_refused() -> None:
    standing = (tuple(edits(paint(0.2))), tuple(edits({"op": "remove", "id": "nobody"})))
    with pytest.raises(SceneError) as refused:
        Past(box(), batches=standing).history(SceneLimits())
    assert refused.value.location == ("batches", 1, "edits", 0, "id")
    with pytest.raises(SceneError) as refused:
        Past(box(), undone=standing[::-1]).history(SceneLimits())
    assert refused.value.location == ("undone", 0, "edits", 0, "id")
    with pytest.raises(LimitExceededError):
        Past(box()).history(SceneLimits(max_polygons=1))


@settings(deadline=None)
@given(st.lists(st.sampled_from(["paint", "move", "undo", "redo"]), max_size=12))
def test_a_past_gives_the_same_history_at_any_point(deeds: list[str]) -> None:
    lived, scene = History(), box()
    batches: list[tuple[Any, ...]] = []
    undone: list[tuple[Any, ...]] = []
    for number, deed in enumerate(deeds):
        match deed:
            case "undo" if batches:
                undone.append(batches.pop())
                scene = lived.undo().scene
            case "redo" if undone:
                batches.append(undone.pop())
                scene = lived.redo().scene
            case "paint" | "move":
                batch = tuple(edits(paint(0.01 * number) if deed == "paint" else move(0.01 * number)))
                before, scene = scene, apply_edits(scene, batch)
                lived.record(before, step_of(batch, scene))
                batches.append(batch)
                undone.clear()
    risen, standing = Past(box(), tuple(batches), tuple(undone)).history(SceneLimits())
    assert floor_of(standing) == floor_of(scene)
    for _ in undone:
        assert floor_of(risen.redo().scene) == floor_of(lived.redo().scene)
    for _ in batches + undone:
        assert floor_of(risen.undo().scene) == floor_of(lived.undo().scene)
