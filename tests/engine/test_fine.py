"""Fine light in the engine: interpolants for cameras in use, and gathered frames, on a solution at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.engine.status import SessionState
from solver.illumination.interpolation import interpolants
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS
from tests.engine.acting import LOOSE, edits, settle
from tests.engine.scenes import box

SMALL = CameraChoice(width=48, height=36)
FRAME = FrameRequest(SMALL, RendererName.INTERPOLANT)
GATHER = FrameRequest(SMALL, RendererName.GATHER)


def complete(engine: Engine, request: FrameRequest = FRAME) -> Engine:
    """The engine once a frame of `request` cannot get better."""
    while engine.outlook(request).improving:
        engine.step(0.05)
    return engine


@pytest.fixture(scope="module")
def fine(drawing: Drawing) -> Engine:
    return complete(Engine(box(), LOOSE, drawing=drawing))


def test_an_early_frame_shows_the_solution_as_it_is(drawing: Drawing) -> None:
    engine = Engine(box(), LOOSE, drawing=drawing)
    early = engine.frame(FRAME)
    assert not early.outlook.converged and early.outlook.improving
    gouraud = engine.frame(replace(FRAME, renderer=RendererName.GOURAUD))
    np.testing.assert_array_equal(early.image, gouraud.image)
    settle(engine)
    assert engine.status().fine.triangles == 0, "nothing is built before somebody looks at a solution at rest"
    complete(engine)
    late = engine.frame(FRAME)
    assert late.outlook.converged and not late.outlook.improving
    assert late.outlook.tag != early.outlook.tag


def test_interpolants_show_what_a_gather_computes(fine: Engine) -> None:
    shown = fine.frame(FRAME).image @ LUMINANCE_WEIGHTS
    complete(fine, GATHER)
    exact = fine.frame(GATHER).image @ LUMINANCE_WEIGHTS
    gouraud = fine.frame(replace(FRAME, renderer=RendererName.GOURAUD)).image @ LUMINANCE_WEIGHTS
    error, before = (np.sqrt(np.mean((of - exact) ** 2) / np.mean(exact**2)) for of in (shown, gouraud))
    assert error < LOOSE.interpolation_tolerance
    assert error < 0.5 * before


def test_only_what_is_seen_is_built(fine: Engine) -> None:
    before = fine.status().fine
    assert 0 < before.interpolants < before.triangles
    assert before.discontinuities >= before.discontinuities_active > 0
    side = replace(FRAME, camera=CameraChoice("side", width=48, height=36))
    assert fine.outlook(side).improving
    complete(fine, side)
    after = fine.status().fine
    assert after.interpolants > before.interpolants
    assert after.point_irradiances > before.point_irradiances
    assert fine.outlook(FRAME).converged, "the first camera still has its own"


def test_layers_of_interpolants(fine: Engine) -> None:
    layers = {
        layer: fine.frame(replace(FRAME, layer=layer)).image
        for layer in (LayerName.TRIANGLE, LayerName.BARYCENTRIC, LayerName.ERROR, LayerName.FALSE_COLOUR)
    }
    seen = layers[LayerName.TRIANGLE] >= 0
    assert seen.any()
    np.testing.assert_allclose(layers[LayerName.BARYCENTRIC][seen].sum(axis=-1), 1.0, atol=1e-5)
    assert np.all(layers[LayerName.ERROR][seen] >= 0.0)
    assert layers[LayerName.FALSE_COLOUR].shape == (36, 48, 3)


def test_settings_of_interpolants_do_not_solve_anew(drawing: Drawing) -> None:
    engine = complete(Engine(box(), LOOSE, drawing=drawing))
    links, tag = engine.status().statistics.links, engine.outlook(FRAME).tag
    coarse = engine.status().fine
    engine.configure(replace(LOOSE, max_leaf_discontinuities=0, interpolation_error=0.2))
    assert engine.status().state is SessionState.CONVERGED
    assert engine.status().statistics.links == links
    assert engine.outlook(FRAME).tag != tag
    complete(engine)
    assert engine.status().fine.discontinuities_active == 0 < coarse.discontinuities_active


def test_a_finer_tolerance_errs_less_and_takes_more(drawing: Drawing) -> None:
    large = replace(FRAME, camera=CameraChoice(width=320, height=240))
    told, points = [], []
    for error in (0.05, 0.002):
        engine = Engine(box(), replace(LOOSE, interpolation_error=error), drawing=drawing)
        complete(engine, large)
        fine = engine._showing.fine
        assert fine is not None
        added = fine.interpolation_error(large.camera.resolve(engine.scene))
        assert added is not None and 0.0 < added <= error
        told.append(added)
        points.append(engine.status().fine.point_irradiances)
    assert told[1] < told[0] and points[1] > 1.2 * points[0]


def test_where_no_more_triangles_are_allowed_all_that_is_seen_is_built_all_the_same(
    drawing: Drawing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However much of the error is in cells that would be split, before the others are built."""
    monkeypatch.setattr(interpolants, "_BATCH", 64)
    large = replace(FRAME, camera=CameraChoice(width=320, height=240))
    strict = replace(LOOSE, interpolation_error=1e-4, max_triangles=1)
    engine = complete(Engine(box(), strict, drawing=drawing), large)
    fine = engine._showing.fine
    assert fine is not None and fine.is_complete(large.camera.resolve(engine.scene))
    assert engine.outlook(large).converged


def test_an_edit_begins_anew(drawing: Drawing) -> None:
    engine = complete(Engine(box(), LOOSE, drawing=drawing))
    engine.apply(edits({"op": "move", "id": "crate", "transform": {"translation": [0.5, 0.5, 0.5]}}))
    assert engine.status().fine.triangles == 0
    assert not engine.outlook(FRAME).converged
    complete(engine)
    assert engine.outlook(FRAME).converged


def test_a_gather_is_shown_once_every_pixel_has_its_light(drawing: Drawing) -> None:
    engine = Engine(box(), LOOSE, drawing=drawing)
    assert not engine.outlook(GATHER).drawable
    complete(engine, GATHER)
    outlook = engine.outlook(GATHER)
    assert outlook.drawable and outlook.converged
    lux = engine.frame(replace(GATHER, layer=LayerName.ILLUMINANCE)).image
    light = engine.frame(replace(GATHER, layer=LayerName.IRRADIANCE)).image
    np.testing.assert_allclose(lux, 179.0 * (light @ LUMINANCE_WEIGHTS), rtol=1e-4)


def test_settings_have_defaults_that_follow_from_the_tolerance() -> None:
    assert LightSettings(error_tolerance=0.04).interpolation_tolerance == 0.02
    assert LightSettings(interpolation_error=0.3).interpolation_tolerance == 0.3
    assert LightSettings().solves_as(LightSettings(point_accuracy=0.1, interpolation_error=0.2))
    assert not LightSettings().solves_as(LightSettings(error_tolerance=0.1))
