"""The engine: a solve in slices, and edits that are atomic and seen at once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.document.limits import SceneLimits
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import (
    CameraChoice,
    FrameRequest,
    LayerName,
    RendererName,
)
from solver.engine.status import ChangeState, SessionState
from solver.errors import LimitExceededError, RevisionConflictError, SceneError
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS, AnyArray
from tests.engine.acting import LOOSE, edits, settle
from tests.engine.scenes import box

MOVE = {"op": "move", "id": "crate", "transform": {"translation": [-0.5, -0.5, 0.5]}}
FACING_DOWN = {"vertices": [[-1, -1, -1], [-1, 1, -1], [1, 1, -1], [1, -1, -1]], "faces": [[0, 1, 2, 3]]}


def objects_seen(engine: Engine) -> AnyArray:
    return engine.frame(FrameRequest(layer=LayerName.OBJECT)).image


# --- the solve ---


def test_an_engine_starts_unsolved_and_converges(engine: Engine) -> None:
    first = engine.status()
    assert (first.revision, first.state, first.progress) == (1, SessionState.SOLVING, 0.0)
    assert first.name == "box"
    assert first.error_estimate == 1.0
    settle(engine)
    last = engine.status()
    assert (last.revision, last.state, last.progress) == (1, SessionState.CONVERGED, 1.0)
    assert 0.0 < last.error_estimate <= LOOSE.error_tolerance
    assert last.statistics.elements > first.statistics.elements
    assert not engine.step(0.1), "nothing is left to do"


def test_who_waits_sees_what_the_last_step_came_to(engine: Engine) -> None:
    """The step that ends the solve is not idle: what waits for its light is asked again, and begun."""
    while engine.status().state is SessionState.SOLVING:
        assert engine.step(10.0)
    assert not engine.step(10.0)
    request = FrameRequest()
    assert engine.outlook(request).improving
    while not engine.outlook(request).converged:
        assert engine.step(10.0)


def test_progress_never_goes_back(drawing: Drawing) -> None:
    engine = Engine(box(), LightSettings(error_tolerance=0.005), drawing=drawing)
    told = [engine.status().progress]
    while engine.step(0.001):
        told.append(engine.status().progress)
    assert told == sorted(told)
    assert len(set(told)) > 2


def test_an_element_limit_pauses_and_says_so(drawing: Drawing) -> None:
    engine = Engine(box(), LightSettings(error_tolerance=0.001, max_elements=64), drawing=drawing)
    settle(engine)
    status = engine.status()
    assert status.state is SessionState.PAUSED
    assert any("max_elements" in warning for warning in status.warnings)
    engine.configure(LightSettings(error_tolerance=0.05))
    settle(engine)
    assert engine.status().state is SessionState.CONVERGED


def test_other_settings_start_the_work_again(engine: Engine) -> None:
    settle(engine)
    engine.configure(LOOSE)
    assert engine.status().state is SessionState.CONVERGED, "the same settings change nothing"
    engine.configure(LightSettings(error_tolerance=0.02))
    assert engine.status().state is SessionState.SOLVING
    assert engine.revision == 1
    settle(engine)
    assert engine.status().error_estimate <= 0.02


def test_an_empty_scene_converges_to_nothing(drawing: Drawing) -> None:
    engine = Engine(Scene(objects={}), LOOSE, drawing=drawing)
    assert engine.status().state is SessionState.SOLVING
    settle(engine)
    assert engine.status().state is SessionState.CONVERGED
    camera = CameraChoice(eye=(0.0, 0.0, 3.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), width=8, height=6)
    with pytest.raises(SceneError):
        engine.frame(FrameRequest(CameraChoice(name="other")))
    scene = Scene(objects={}, cameras=box().cameras)
    empty = Engine(scene, LOOSE, drawing=drawing)
    assert not empty.frame(FrameRequest(camera)).image.any()


def test_surfaces_that_do_not_see_light_are_dark(drawing: Drawing) -> None:
    scene = box()
    engine = Engine(scene.without_object("crate").without_object("lamp"), LOOSE, drawing=drawing)
    below = {"op": "add", "object": {"id": "below", "mesh": FACING_DOWN, "material": {"emission": [9] * 3}}}
    engine.apply(edits(below))
    settle(engine)
    assert engine.status().state is SessionState.CONVERGED
    assert not engine.frame(FrameRequest(layer=LayerName.IRRADIANCE)).image.any()


# --- edits ---


def test_a_frame_shows_the_geometry_of_its_revision_at_once(engine: Engine) -> None:
    settle(engine)
    before = objects_seen(engine)
    crate = 2
    # Looking down, x goes right and y up, so that the crate goes from the upper right to the lower left.
    assert (before[:24, 24:] == crate).any()
    assert not (before[24:, :24] == crate).any()
    changes = engine.apply(edits(MOVE))
    assert engine.revision == 2
    frame = engine.frame(FrameRequest(layer=LayerName.OBJECT))
    assert frame.outlook.revision == 2
    assert not frame.outlook.converged
    assert (frame.image[24:, :24] == crate).any()
    assert not (frame.image[:24, 24:] == crate).any()
    (change,) = changes
    assert (change.entry, change.revision, change.op, change.id) == (1, 2, "move", "crate")
    assert change.state is ChangeState.PENDING
    assert change.energy_to_redistribute > 0.0


def test_light_stays_where_an_edit_left_it(engine: Engine) -> None:
    settle(engine)
    settled_floor = engine.frame(FrameRequest(renderer=RendererName.FLAT)).image[40:44, 40:44].mean()
    engine.apply(edits(MOVE))
    # The lower right corner of the floor: neither place of the crate shades it much.
    moved = engine.frame(FrameRequest(renderer=RendererName.FLAT)).image[40:44, 40:44].mean()
    assert 0.2 * settled_floor < moved < 2.0 * settled_floor, "before the new solve has begun"


def test_an_edited_engine_comes_to_what_a_fresh_one_does(engine: Engine, drawing: Drawing) -> None:
    settle(engine)
    engine.apply(edits(MOVE, {"op": "set_material", "id": "floor", "material": {"reflectance": [0.1] * 3}}))
    settle(engine)
    fresh = Engine(engine.scene, LOOSE, drawing=drawing)
    settle(fresh)
    one, other = (e.frame(FrameRequest()).image @ LUMINANCE_WEIGHTS for e in (engine, fresh))
    assert math.sqrt(np.sum((one - other) ** 2) / np.sum(other**2)) < LOOSE.error_tolerance


def test_batches_are_numbered_and_entries_counted_on(engine: Engine) -> None:
    first = engine.apply(edits(MOVE, MOVE), if_revision=1)
    second = engine.apply(edits({"op": "remove", "id": "crate"}), if_revision=2)
    assert [change.entry for change in (*first, *second)] == [1, 2, 3]
    assert [change.revision for change in (*first, *second)] == [2, 2, 3]


@pytest.mark.parametrize("solving", [True, False], ids=["while it solves", "when it has converged"])
def test_a_refused_batch_changes_nothing(engine: Engine, solving: bool) -> None:
    if solving:
        engine.step(0.0)
    else:
        settle(engine)
    before, scene, tag = engine.status(), engine.scene, engine.outlook(FrameRequest()).tag
    with pytest.raises(SceneError):
        engine.apply(edits(MOVE, {"op": "remove", "id": "nobody"}))
    with pytest.raises(RevisionConflictError) as conflict:
        engine.apply(edits(MOVE), if_revision=7)
    assert (conflict.value.expected, conflict.value.current) == (7, 1)
    assert engine.status() == before
    assert engine.scene is scene
    assert engine.outlook(FrameRequest()).tag == tag


def test_an_edit_beyond_the_limits_changes_nothing(drawing: Drawing) -> None:
    engine = Engine(box(), LOOSE, SceneLimits(max_polygons=3), drawing)
    mesh = {"vertices": [[0, 0, 1], [1, 0, 1], [0, 1, 1]], "faces": [[0, 1, 2]]}
    with pytest.raises(LimitExceededError):
        engine.apply(edits({"op": "add", "object": {"id": "more", "mesh": mesh}}))
    assert engine.revision == 1
    assert "more" not in engine.scene.objects


def test_a_scene_beyond_the_limits_is_refused(drawing: Drawing) -> None:
    with pytest.raises(LimitExceededError):
        Engine(box(), LOOSE, SceneLimits(max_polygons=2), drawing)


def test_the_ray_hierarchy_is_kept_where_no_triangle_moved(engine: Engine) -> None:
    # Told by what a user can see: a change of material alone keeps depths to the bit.
    before = engine.frame(FrameRequest(layer=LayerName.DEPTH)).image
    engine.apply(edits({"op": "set_material", "id": "floor", "material": {}}))
    assert np.array_equal(engine.frame(FrameRequest(layer=LayerName.DEPTH)).image, before)
