"""The engine: edits that are atomic and seen at once, work in slices, frames and probes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from solver.document.edits import Edit
from solver.document.limits import SceneLimits
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import (
    CameraChoice,
    FrameLimits,
    FrameRequest,
    LayerName,
    NotAvailableError,
    RendererName,
)
from solver.engine.status import ChangeState, SessionState
from solver.errors import LimitExceededError, RevisionConflictError, SceneError
from solver.geometry.scene import Scene
from solver.transport.settings import SolverSettings
from solver.types import LUMINANCE_WEIGHTS, AnyArray
from tests.engine.scenes import box

EDITS: TypeAdapter[list[Edit]] = TypeAdapter(list[Edit])
LOOSE = SolverSettings(error_tolerance=0.05)
MOVE = {"op": "move", "id": "crate", "transform": {"translation": [-0.5, -0.5, 0.5]}}
FACING_DOWN = {"vertices": [[-1, -1, -1], [-1, 1, -1], [1, 1, -1], [1, -1, -1]], "faces": [[0, 1, 2, 3]]}
LAYERS = [
    LayerName.RADIANCE,
    LayerName.IRRADIANCE,
    LayerName.ILLUMINANCE,
    LayerName.DEPTH,
    LayerName.POSITION,
    LayerName.NORMAL,
    LayerName.OBJECT,
    LayerName.ELEMENT,
]


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    made = Drawing()
    assert made.problem is None
    return made


@pytest.fixture
def engine(drawing: Drawing) -> Engine:
    return Engine(box(), LOOSE, drawing=drawing)


@pytest.fixture(scope="module")
def settled(drawing: Drawing) -> Iterator[Engine]:
    """Converged; not to be edited."""
    made = Engine(box(), LOOSE, drawing=drawing)
    settle(made)
    assert made.status().state is SessionState.CONVERGED
    yield made
    assert made.revision == 1


def settle(engine: Engine) -> None:
    while engine.step(0.1):
        pass


def edits(*given: dict[str, Any]) -> list[Edit]:
    return EDITS.validate_python(list(given))


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


def test_progress_never_goes_back(drawing: Drawing) -> None:
    engine = Engine(box(), SolverSettings(error_tolerance=0.005), drawing=drawing)
    told = [engine.status().progress]
    while engine.step(0.001):
        told.append(engine.status().progress)
    assert told == sorted(told)
    assert len(set(told)) > 2


def test_an_element_limit_pauses_and_says_so(drawing: Drawing) -> None:
    engine = Engine(box(), SolverSettings(error_tolerance=0.001, max_elements=64), drawing=drawing)
    settle(engine)
    status = engine.status()
    assert status.state is SessionState.PAUSED
    assert any("max_elements" in warning for warning in status.warnings)
    engine.configure(SolverSettings(error_tolerance=0.05))
    settle(engine)
    assert engine.status().state is SessionState.CONVERGED


def test_other_settings_start_the_work_again(engine: Engine) -> None:
    settle(engine)
    engine.configure(LOOSE)
    assert engine.status().state is SessionState.CONVERGED, "the same settings change nothing"
    engine.configure(SolverSettings(error_tolerance=0.02))
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


# --- frames ---


@pytest.mark.parametrize("layer", LAYERS)
def test_each_layer_has_its_shape_and_unit(settled: Engine, layer: LayerName) -> None:
    image = settled.frame(FrameRequest(layer=layer)).image
    assert image.shape[:2] == (48, 48)
    floor = image[44, 4]  # lower left: x = y = -0.9, about
    match layer:
        case LayerName.DEPTH:
            assert floor == pytest.approx(1.9, rel=1e-5), "along the camera's axis"
        case LayerName.POSITION:
            # The middle of that pixel, on a plane 1.9 m away and 2 * 1.9 * tan 30 degrees across.
            across = 2 * 1.9 * math.tan(math.radians(30)) / 48
            assert floor == pytest.approx([-19.5 * across, -20.5 * across, 0.0], abs=1e-5)
        case LayerName.NORMAL:
            assert floor == pytest.approx([0, 0, 1], abs=1e-6)
        case LayerName.OBJECT:
            assert floor == 0
        case LayerName.ELEMENT:
            assert 0 <= floor < settled.status().statistics.leaves
        case LayerName.ILLUMINANCE:
            irradiance = settled.frame(FrameRequest(layer=LayerName.IRRADIANCE)).image[44, 4]
            assert floor == pytest.approx(179.0 * (irradiance @ LUMINANCE_WEIGHTS), rel=1e-4)
        case LayerName.RADIANCE:
            irradiance = settled.frame(FrameRequest(layer=LayerName.IRRADIANCE)).image[44, 4]
            assert floor == pytest.approx(np.array([0.6, 0.4, 0.2]) * irradiance / math.pi, rel=1e-4)
        case _:
            assert np.all(floor > 0.0)


def test_flat_and_gouraud_agree_on_the_whole(settled: Engine) -> None:
    flat, gouraud = (
        settled.frame(FrameRequest(renderer=renderer)).image.mean(axis=(0, 1))
        for renderer in (RendererName.FLAT, RendererName.GOURAUD)
    )
    assert flat == pytest.approx(gouraud, rel=0.05)


def test_the_witness_sees_what_the_solve_does(drawing: Drawing) -> None:
    """Frames come nearer to the path-traced one as the tolerance falls."""
    differences = []
    for tolerance in (0.05, 0.005):
        engine = Engine(box(), SolverSettings(error_tolerance=tolerance), drawing=drawing)
        settle(engine)
        request = FrameRequest(renderer=RendererName.PATH, samples=256)
        while not engine.outlook(request).drawable:
            engine.step(0.05)
        traced = engine.frame(request)
        assert traced.outlook.renderer is RendererName.PATH
        assert 0.0 < traced.outlook.error_estimate < 0.02
        truth = traced.image @ LUMINANCE_WEIGHTS
        drawn = engine.frame(FrameRequest(samples=16)).image @ LUMINANCE_WEIGHTS
        differences.append(math.sqrt(np.sum((drawn - truth) ** 2) / np.sum(truth**2)))
    # Pixels see the edges of shadows, which the tolerance of elements averages over.
    assert differences[1] < 0.03
    assert differences[1] < 0.5 * differences[0]


def test_a_path_traced_frame_converges_and_then_rests(settled: Engine) -> None:
    request = FrameRequest(CameraChoice(name="side"), renderer=RendererName.PATH)
    outlook = settled.outlook(request)
    assert not outlook.drawable
    assert outlook.improving
    while settled.step(0.05):
        pass
    outlook = settled.outlook(request)
    assert outlook.converged
    assert outlook.error_estimate <= LOOSE.error_tolerance
    assert not outlook.improving
    assert np.isfinite(settled.frame(request).image).all()


def test_tags_tell_pictures_apart(engine: Engine) -> None:
    request = FrameRequest()
    first = engine.outlook(request).tag
    settle(engine)
    second = engine.outlook(request).tag
    assert engine.outlook(request).tag == second
    engine.apply(edits({"op": "move", "id": "crate", "transform": {"translation": [0.5, 0.5, 0.5]}}))
    assert len({first, second, engine.outlook(request).tag}) == 3


@pytest.mark.parametrize("renderer", [RendererName.INTERPOLANT, RendererName.VPL, RendererName.GATHER])
def test_a_renderer_that_is_still_to_come_says_so(settled: Engine, renderer: RendererName) -> None:
    with pytest.raises(NotAvailableError) as refused:
        settled.frame(FrameRequest(renderer=renderer))
    assert RendererName.GOURAUD in refused.value.available


@pytest.mark.parametrize(
    "layer", [LayerName.TRIANGLE, LayerName.BARYCENTRIC, LayerName.ERROR, LayerName.FALSE_COLOUR]
)
def test_a_layer_that_is_still_to_come_says_so(settled: Engine, layer: LayerName) -> None:
    with pytest.raises(NotAvailableError) as refused:
        settled.frame(FrameRequest(layer=layer))
    assert LayerName.RADIANCE in refused.value.available


def test_the_path_renderer_has_radiance_alone(settled: Engine) -> None:
    with pytest.raises(NotAvailableError):
        settled.frame(FrameRequest(renderer=RendererName.PATH, layer=LayerName.DEPTH))


@pytest.mark.parametrize(
    ("camera", "samples"),
    [
        (CameraChoice(width=101), 1),
        (CameraChoice(height=101), 1),
        (CameraChoice(width=90, height=90), 1),
        (CameraChoice(), 9),
    ],
)
def test_frames_have_limits(drawing: Drawing, camera: CameraChoice, samples: int) -> None:
    limits = FrameLimits(max_width=100, max_height=100, max_pixels=8000, max_samples=8)
    engine = Engine(box(), LOOSE, drawing=drawing, frame_limits=limits)
    with pytest.raises(LimitExceededError):
        engine.frame(FrameRequest(camera, samples=samples))
    engine.frame(FrameRequest(CameraChoice(width=80, height=100), samples=8))


# --- probes ---


def test_a_probe_under_the_lamp_is_lambert_s_formula(settled: Engine) -> None:
    positions = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]])
    result = settled.probe(positions, np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -1.0]]))
    # A square of side 1 seen from 2 m below its middle: four times the corner of a rectangle 1/2 by 1/2.
    x = 0.25
    corner = x / math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x)) / math.pi
    direct = 4 * corner * np.array([10, 10, 8])
    # The crate hangs aside, and what it reflects is little.
    assert result.irradiance[0] == pytest.approx(direct, rel=0.05)
    assert result.illuminance[0] == pytest.approx(179.0 * (result.irradiance[0] @ LUMINANCE_WEIGHTS))
    # Looking down from 10 cm, it sees little but the floor, of reflectance 0.6, 0.4, 0.2.
    assert result.irradiance[1] == pytest.approx(np.array([0.6, 0.4, 0.2]) * direct, rel=0.1)
    assert result.revision == 1
    assert np.all(result.error_estimate >= 0.0)


def test_a_probe_of_no_points_is_empty(settled: Engine) -> None:
    result = settled.probe(np.empty((0, 3)), np.empty((0, 3)))
    assert result.irradiance.shape == (0, 3)
