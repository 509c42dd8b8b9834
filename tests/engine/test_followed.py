"""Frames after an edit: interpolants of the solution before it that follow the light of the present one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.followed import follow
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.engine.status import SessionState
from solver.illumination.settings import LightSettings
from solver.transport.solve import RadiositySolver
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from tests.engine.acting import edits
from tests.engine.scenes import furnished

SETTINGS = LightSettings(error_tolerance=0.03)
FINER = LightSettings(error_tolerance=0.01)
FRAME = FrameRequest(CameraChoice(width=96, height=72), RendererName.INTERPOLANT, LayerName.IRRADIANCE)
DEPTH = replace(FRAME, layer=LayerName.DEPTH)

MOVE = {"op": "move", "id": "a", "transform": {"translation": [2.5, 1.8, 0.0]}}
PAINT = {"op": "set_material", "id": "b", "material": {"reflectance": [0.1, 0.1, 0.1]}}
DIM = {"op": "set_material", "id": "lamp", "material": {"emission": [3.0, 3.0, 3.0]}}
DARK = {"op": "set_material", "id": "lamp", "material": {"emission": [0.0, 0.0, 0.0]}}


def shown(engine: Engine, request: FrameRequest = FRAME) -> FloatArray:
    """Luminance irradiance of a frame as it is now, W/m2."""
    image = np.asarray(engine.frame(request).image, dtype=np.float64)
    return np.asarray(image[..., :3] @ LUMINANCE_WEIGHTS)


def finished(engine: Engine) -> Engine:
    while not engine.outlook(FRAME).converged:
        engine.step(0.05)
    return engine


def looked_at(drawing: Drawing) -> Engine:
    return finished(Engine(furnished(), SETTINGS, drawing=drawing))


def edited(drawing: Drawing, *changes: dict[str, Any]) -> Engine:
    """An engine after edits, whose light has settled, and nothing is built on it yet."""
    engine = looked_at(drawing)
    for change in changes:
        engine.apply(edits(change))
    engine.outlook(FRAME)
    while engine.status().state is SessionState.SOLVING:
        engine.step(0.0)
    assert engine.status().fine.triangles == 0
    return engine


def off(found: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2)))


def test_without_an_edit_they_are_what_they_were(drawing: Drawing) -> None:
    engine = looked_at(drawing)
    fine, solution = engine._showing.fine, engine._solution
    assert fine is not None and fine.interpolants is not None
    followed = follow(fine)
    assert followed is not None and followed.interpolants is fine.interpolants
    assert followed.mesh(solution, drawing) is None, "of a fresh solve no change is known"
    solver, known = solution.solver, fine.interpolants.mesh()
    assert isinstance(solver, RadiositySolver)
    number = np.arange(known.surfaces.patch_count, dtype=np.int32)
    found = followed._following.follow(solver.state, number, np.zeros(len(solver.state.tree)))
    assert not found.by_elements.any()
    np.testing.assert_array_equal(found.triangles, np.arange(len(known.triangles)))
    scale = np.abs(known.coefficients).max()
    np.testing.assert_allclose(found.coefficients, known.coefficients, atol=2e-6 * scale)


@pytest.mark.parametrize(
    "changes", [(MOVE,), (PAINT,), (DIM,), (MOVE, PAINT)], ids=["move", "paint", "dim", "both"]
)
def test_they_are_nearer_to_what_will_be_there_than_elements_are(
    drawing: Drawing, changes: tuple[dict[str, Any], ...]
) -> None:
    engine = edited(drawing, *changes)
    early = shown(engine)
    elements = shown(engine, replace(FRAME, renderer=RendererName.GOURAUD))
    truth = shown(finished(Engine(engine.scene, FINER, drawing=drawing)))
    assert off(early, truth) < 0.6 * off(elements, truth)
    assert off(early, truth) < SETTINGS.error_tolerance


def test_they_follow_from_the_first_frame_on(drawing: Drawing) -> None:
    engine = looked_at(drawing)
    engine.apply(edits(MOVE))
    early = shown(engine)
    assert engine.status().fine.triangles == 0
    elements = shown(engine, replace(FRAME, renderer=RendererName.GOURAUD))
    truth = shown(finished(engine))
    assert off(early, truth) < off(elements, truth)


def test_what_has_moved_is_drawn_where_it_is(drawing: Drawing) -> None:
    engine = edited(drawing, MOVE)
    fresh = Engine(engine.scene, SETTINGS, drawing=drawing)
    np.testing.assert_array_equal(engine.frame(DEPTH).image, fresh.frame(DEPTH).image)
    # Where a crate was there is no hole, and where it is it is seen.
    assert shown(engine).min() > 0.0


def test_without_light_nothing_is_left_of_it(drawing: Drawing) -> None:
    assert shown(edited(drawing, DARK)).max() == 0.0


def test_in_a_drag_frames_are_as_near(drawing: Drawing) -> None:
    engine = looked_at(drawing)
    for step in range(1, 6):
        place = [2.6 - 0.02 * step, 1.9 - 0.02 * step, 0.0]
        engine.apply(edits(MOVE | {"transform": {"translation": place}}))
        early = shown(engine)
        elements = shown(engine, replace(FRAME, renderer=RendererName.GOURAUD))
    truth = shown(finished(engine))
    assert off(early, truth) < off(elements, truth)


def test_frames_have_a_tag_of_their_own_until_others_are_there(drawing: Drawing) -> None:
    engine = edited(drawing, MOVE)
    early = engine.frame(FRAME)
    assert early.outlook.improving and not early.outlook.converged
    assert finished(engine).frame(FRAME).outlook.tag != early.outlook.tag
