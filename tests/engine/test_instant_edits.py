"""Frames by virtual lights while the scene changes: new geometry at once, new light block by block."""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.types import AnyArray, BoolArray
from tests.engine.acting import edits
from tests.engine.scenes import box
from tests.engine.test_instant import QUICK, VPL, difference, instant, paths, unsolved

__all__ = ["instant", "unsolved"]

AWAY = {"op": "move", "id": "crate", "transform": {"translation": [-0.5, -0.4, 0.6]}}


def shown(engine: Engine) -> AnyArray:
    """Objects (h, w) that pixels show."""
    return engine.frame(FrameRequest(renderer=RendererName.FLAT, layer=LayerName.OBJECT)).image


def moved(engine: Engine) -> tuple[AnyArray, BoolArray]:
    """The frame right after the crate was moved, and which pixels show what they have shown before."""
    before = shown(engine)
    engine.apply(edits(AWAY))
    after = shown(engine)
    same = (before == after) & (after != 2)
    assert 0.5 < same.mean() < 0.95
    return engine.frame(VPL).image, same


def test_geometry_is_new_at_once_and_light_where_it_was(instant: Engine) -> None:
    old = paths(instant, 64).astype(np.float32)
    image, same = moved(instant)
    np.testing.assert_allclose(image[same], old[same], rtol=1e-5)
    assert not image[~same].any(), "nothing is known of the light there"
    outlook = instant.outlook(VPL)
    assert (outlook.drawable, outlook.converged, outlook.improving) == (False, False, True)
    assert outlook.error_estimate == 1.0
    assert outlook.revision == 2


def test_pixels_that_show_something_else_have_new_light_alone(instant: Engine, drawing: Drawing) -> None:
    paths(instant, 64)
    _, same = moved(instant)
    image = paths(instant, 8)
    fresh = paths(Engine(instant.scene, QUICK, drawing=drawing), 8)
    np.testing.assert_allclose(image[~same], fresh[~same], rtol=1e-5)
    assert instant.outlook(VPL).drawable
    # Elsewhere an eighth is new.
    assert difference(image[same], fresh[same]) > 0.0


def test_old_light_fades_block_by_block(instant: Engine, drawing: Drawing) -> None:
    """And once all blocks are replaced, the frame is that of a session of the new scene, bit for bit."""
    paths(instant, 512)
    moved(instant)
    fresh_engine = Engine(instant.scene, QUICK, drawing=drawing)
    fresh = paths(fresh_engine, 512)
    errors = [difference(paths(instant, count), fresh) for count in (8, 24, 40, 64)]
    assert errors[3] < 0.6 * errors[0]
    assert errors == sorted(errors, reverse=True)
    np.testing.assert_array_equal(paths(instant, 512), fresh)
    assert instant.outlook(VPL).error_estimate == fresh_engine.outlook(VPL).error_estimate


def test_edits_in_a_row(instant: Engine, drawing: Drawing) -> None:
    """Each takes over what the one before has shown, whether or not that was asked for."""
    old = paths(instant, 64).astype(np.float32)
    before = shown(instant)
    for height in (0.6, 0.7, 0.8):
        move = {"op": "move", "id": "crate", "transform": {"translation": [0.5, 0.5, height]}}
        instant.apply(edits(move))
        if height == 0.7:
            paths(instant, 16)
    same = (before == shown(instant)) & (before == 0)
    image = instant.frame(VPL).image
    assert image[same].min() > 0.0
    assert difference(image[same], old[same]) < 0.5
    np.testing.assert_array_equal(
        paths(instant, 64), paths(Engine(instant.scene, QUICK, drawing=drawing), 64)
    )


def test_a_new_material_is_seen_at_once_under_the_old_light(instant: Engine) -> None:
    paths(instant, 64)
    irradiance = instant.frame(FrameRequest(renderer=RendererName.VPL, layer=LayerName.IRRADIANCE)).image
    paint = {"op": "set_material", "id": "floor", "material": {"reflectance": [0.1, 0.2, 0.9]}}
    instant.apply(edits(paint))
    floor = shown(instant) == 0
    expected = np.array([0.1, 0.2, 0.9]) / np.pi * irradiance[floor]
    np.testing.assert_allclose(instant.frame(VPL).image[floor], expected, rtol=1e-4)


def test_a_lamp_switched_off_is_dark_when_all_is_new(instant: Engine) -> None:
    paths(instant, 64)
    off = {"op": "set_material", "id": "lamp", "material": {"reflectance": [0.0, 0.0, 0.0]}}
    instant.apply(edits(off))
    light = [instant.frame(VPL).image.mean(), *(paths(instant, n).mean() for n in (8, 32, 64))]
    assert light[0] > light[1] > light[2] > light[3] == 0.0
    assert instant.outlook(VPL).converged


def test_all_cameras_take_over(instant: Engine) -> None:
    side = FrameRequest(CameraChoice("side"), renderer=RendererName.VPL)
    lit = paths(instant, 64), paths(instant, 64, side)
    instant.apply(edits(AWAY))
    for request, before in zip((VPL, side), lit, strict=True):
        image = instant.frame(request).image
        assert np.any(image > 0.0)
        kept = (image > 0.0).any(axis=2)
        np.testing.assert_allclose(image[kept], before[kept], rtol=1e-5)


@pytest.mark.parametrize("samples", [4])
def test_samples_take_over_each_their_own(instant: Engine, samples: int) -> None:
    request = FrameRequest(renderer=RendererName.VPL, samples=samples)
    old = paths(instant, 128, request)
    instant.apply(edits({"op": "remove", "id": "crate"}))
    image = instant.frame(request).image
    same = np.abs(image - old).max(axis=2) <= 1e-5 * old.max()
    assert same.mean() > 0.6
    assert np.all(image <= old + 1e-5 * old.max()), "parts of pixels are lost, and no light made up"


def test_objects_that_come_into_an_empty_view(drawing: Drawing) -> None:
    engine = Engine(box().without_object("floor").without_object("crate"), QUICK, drawing=drawing)
    assert not paths(engine, 64).any()
    floor = {
        "op": "add",
        "object": {
            "id": "floor",
            "mesh": {"vertices": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "faces": [[0, 1, 2, 3]]},
            "material": {"reflectance": [0.6, 0.4, 0.2]},
        },
    }
    engine.apply(edits(floor))
    assert not engine.frame(VPL).image.any()
    assert np.all(paths(engine, 8)[20:28, 20:28] > 0.0)
