"""Undo and redo, and the change log."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.engine import history
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.history import Difference, NothingToReverseError
from solver.engine.status import ChangeState
from solver.geometry.parts import part_of
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from tests.engine.acting import edits, settle
from tests.engine.scenes import box


def move(x: float) -> dict[str, Any]:
    return {"op": "move", "id": "crate", "transform": {"translation": [x, 0.5, 0.5]}}


def paint(grey: float) -> dict[str, Any]:
    return {"op": "set_material", "id": "floor", "material": {"reflectance": [grey] * 3}}


@pytest.fixture
def engine(drawing: Drawing) -> Engine:
    return Engine(box(), LightSettings(error_tolerance=0.05), drawing=drawing)


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    return Drawing()


def told(engine: Engine) -> list[tuple[str, str]]:
    return [(entry.op, entry.id) for entry in engine.log()]


def things_of(scene: Scene) -> list[tuple[Any, ...]]:
    """What tells objects apart, in their order."""
    return [(thing.id, thing.mesh, thing.material, thing.transform) for thing in scene]


def assert_is(engine: Engine, scene: Scene, revision: int) -> None:
    assert things_of(engine.scene) == things_of(scene)
    assert engine.revision == revision


def test_batches_are_taken_back_and_brought_back_whole(engine: Engine) -> None:
    scenes = [engine.scene]
    for batch in ([move(0.1), paint(0.2)], [{"op": "remove", "id": "crate"}]):
        engine.apply(edits(*batch))
        scenes.append(engine.scene)
    changes = engine.undo()
    assert_is(engine, scenes[1], 4)
    assert [(change.op, change.id) for change in changes] == [("add", "crate")]
    changes = engine.undo()
    assert_is(engine, scenes[0], 5)
    assert [(change.op, change.id) for change in changes] == [("set_material", "floor"), ("move", "crate")]
    engine.redo()
    assert_is(engine, scenes[1], 6)
    engine.redo()
    assert_is(engine, scenes[2], 7)


def test_there_may_be_nothing_to_take_back(engine: Engine) -> None:
    for reverse in (engine.undo, engine.redo):
        with pytest.raises(NothingToReverseError):
            reverse()
    assert engine.revision == 1


def test_an_edit_ends_what_could_be_brought_back(engine: Engine) -> None:
    engine.apply(edits(move(0.1)))
    engine.undo()
    engine.apply(edits(paint(0.2)))
    with pytest.raises(NothingToReverseError):
        engine.redo()
    engine.undo()
    before = box().object("floor").material.reflectance
    np.testing.assert_array_equal(engine.scene.object("floor").material.reflectance, before)


def test_a_refused_batch_leaves_no_trace(engine: Engine) -> None:
    with pytest.raises(Exception, match="nobody"):
        engine.apply(edits(move(0.1), {"op": "remove", "id": "nobody"}))
    with pytest.raises(NothingToReverseError):
        engine.undo()
    assert engine.log() == ()


@given(st.lists(st.tuples(st.sampled_from(["add", "remove", "paint"]), st.integers(0, 4)), max_size=8))
def test_a_scene_is_another_one_and_what_is_different(deeds: list[tuple[str, int]]) -> None:
    before = after = box()
    crate = before.object("crate")
    for deed, number in deeds:
        name = f"crate{number}"
        if deed == "add" and name not in after.objects:
            after = after.with_object(replace(crate, id=name))
        elif deed == "remove" and name in after.objects:
            after = after.without_object(name)
        elif deed == "paint" and name in after.objects:
            material = replace(crate.material)
            after = after.with_replaced(replace(after.object(name), material=material))
        if number == 0:
            before = after
    for one, other in ((before, after), (after, before)):
        found = Difference.between(one, other)
        assert things_of(found.of(one)) == things_of(other)


def test_a_batch_of_many_objects_keeps_those_that_it_changed() -> None:
    before = box()
    for number in range(500):
        before = before.with_object(replace(before.object("crate"), id=f"crate{number}"))
    after = before.without_object("crate7").with_replaced(replace(before.object("crate9")))
    found = Difference.between(after, before)
    assert ({thing.id for thing in found.changed}, found.gone) == ({"crate7", "crate9"}, ())
    assert [id for _, id in found.places] == ["crate7"]


def test_what_was_made_of_objects_is_not_kept(engine: Engine) -> None:
    made = weakref.WeakSet[Any]()
    for number in range(20):
        engine.apply(edits(move(0.01 * number)))
        engine.status()
        made.add(part_of(engine.scene.object("crate"), engine._world.surfaces.size))
        if number % 5 == 4:
            engine.undo()
            engine.redo()
    gc.collect()
    assert len(made) <= 2


def test_only_so_many_batches_are_kept(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "KEPT", 2)
    kept = history.History()
    for _ in range(3):
        kept.record(engine.scene, history.Step(engine.scene, ()))
    kept.undo()
    kept.undo()
    with pytest.raises(NothingToReverseError):
        kept.undo()


def test_the_light_after_undo_is_that_before(engine: Engine) -> None:
    settle(engine)
    before = engine.status().error_estimate
    engine.apply(edits({"op": "remove", "id": "crate"}))
    engine.step(0.05)
    engine.undo()
    settle(engine)
    assert engine.status().error_estimate <= max(before, 0.05)
    assert all(entry.state is ChangeState.SETTLED for entry in engine.log())


def test_entries_settle_with_the_light(engine: Engine) -> None:
    settle(engine)
    engine.apply(edits({"op": "remove", "id": "crate"}, paint(0.3)))
    first, second = engine.log()
    assert (first.entry, second.entry, first.revision) == (1, 2, 2)
    assert {first.state, second.state} == {ChangeState.PENDING}
    assert first.energy_to_redistribute > 0.0
    seen = set()
    while engine.step(0.001):
        seen |= {entry.state for entry in engine.log()}
    first, second = engine.log()
    assert {first.state, second.state} == {ChangeState.SETTLED}
    assert first.energy_to_redistribute == second.energy_to_redistribute == 0.0
    assert first.shots > 0
    engine.apply(edits(paint(0.4)))
    assert [entry.state for entry in engine.log()] == ["settled", "settled", "pending"]


def test_an_interrupted_change_stays(engine: Engine) -> None:
    engine.apply(edits(paint(0.3)))
    engine.step(0.0)
    engine.apply(edits({"op": "remove", "id": "crate"}))
    assert [entry.state for entry in engine.log()][1] is ChangeState.PENDING
    assert engine.log()[0].state is not ChangeState.SETTLED
    assert engine.log()[0].energy_to_redistribute > 0.0
    settle(engine)
    assert {entry.state for entry in engine.log()} == {ChangeState.SETTLED}


def test_a_drag_is_one_removal_and_one_addition(engine: Engine) -> None:
    settle(engine)
    engine.apply(edits(move(0.0)))
    assert told(engine) == [("move", "crate")]
    for k in range(1, 20):
        engine.apply(edits(move(0.02 * k)))
        engine.step(0.0)
    assert told(engine) == [("remove", "crate"), ("add", "crate")]
    newest = engine.log()[-1]
    assert (newest.revision, newest.entry) == (engine.revision, 20)
    settle(engine)
    assert {entry.state for entry in engine.log()} == {ChangeState.SETTLED}


def test_moves_of_others_and_additions_are_not_folded(engine: Engine) -> None:
    lamp = {"op": "move", "id": "lamp", "transform": {"translation": [0, 0, 0.1]}}
    engine.apply(edits(move(0.0), lamp, move(0.1), lamp))
    assert told(engine) == [("move", "crate"), ("move", "lamp")] * 2
    engine.apply(edits({"op": "remove", "id": "crate"}))
    engine.undo()
    engine.apply(edits(move(0.2)))
    assert told(engine)[-3:] == [("remove", "crate"), ("add", "crate"), ("move", "crate")]
