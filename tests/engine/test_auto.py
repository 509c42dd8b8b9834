"""Frames by whichever renderer has the least estimated error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from solver.engine import auto
from solver.engine.auto import AutoView
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.frame_times import FrameTimes
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName, Wait, WaitFor
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from solver.types import AnyArray
from tests.engine.acting import LOOSE, settle
from tests.engine.scenes import box

AUTO = FrameRequest(CameraChoice(width=32, height=24), RendererName.AUTO)
SMALL_STEP = 0.002


def glossy() -> Scene:
    """The box with a crate that shines."""
    scene = box()
    crate = scene.object("crate")
    material = replace(crate.material, specular=np.full(3, 0.2), exponent=30.0)
    return scene.with_replaced(replace(crate, material=material))


def test_a_settled_diffuse_scene_is_drawn_by_interpolants(settled: Engine) -> None:
    frame = settled.frame(AUTO)
    assert frame.outlook.renderer is RendererName.INTERPOLANT
    named = settled.frame(replace(AUTO, renderer=RendererName.INTERPOLANT))
    assert np.array_equal(frame.image, named.image)
    assert frame.outlook.error_estimate == named.outlook.error_estimate


@pytest.mark.parametrize("layer", [LayerName.RADIANCE, LayerName.ILLUMINANCE, LayerName.NORMAL])
def test_every_layer_has_somebody_who_draws_it(drawing: Drawing, layer: LayerName) -> None:
    for scene in (box(), glossy()):
        engine = Engine(scene, LOOSE, drawing=drawing)
        request = replace(AUTO, layer=layer)
        while not engine.outlook(request).drawable:
            engine.step(SMALL_STEP)
        assert np.isfinite(engine.frame(request).image).any()


def test_light_that_is_not_diffuse_is_left_to_those_who_know_it(drawing: Drawing) -> None:
    engine = Engine(glossy(), LightSettings(error_tolerance=0.05), drawing=drawing)
    while engine.outlook(AUTO).improving and not engine.outlook(AUTO).converged:
        engine.step(0.05)
    found = engine.outlook(AUTO)
    assert found.converged
    assert found.renderer in (RendererName.VPL, RendererName.PATH)


def test_a_large_scene_shows_the_least_error_while_it_is_linked(
    drawing: Drawing, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(auto, "_QUICK", 1)  # as if the box were large
    engine = Engine(box(), LightSettings(error_tolerance=0.01), drawing=drawing)
    compared = 0
    while engine.status().state == "solving":
        each = [
            engine.outlook(replace(AUTO, renderer=renderer))
            for renderer in (RendererName.INTERPOLANT, RendererName.VPL)
        ]
        if not any(one.converged for one in each):
            told = engine.outlook(AUTO)
            assert told.error_estimate == min(one.error_estimate for one in each if one.drawable)
            compared += 1
        engine.step(SMALL_STEP)
    assert compared > 5
    settle(engine)
    assert engine.outlook(AUTO).renderer is RendererName.INTERPOLANT


@dataclass
class Told:
    """A view that says what it is told to."""

    error_estimate: float
    converged: bool = False
    drawable: bool = True
    improving: bool = True
    version: str = "1"

    def draw(self) -> AnyArray:
        return np.full((1, 1, 3), self.error_estimate)


@pytest.mark.parametrize(
    ("first", "second", "chosen"),
    [
        (Told(0.1), Told(0.2), 0),
        (Told(0.2), Told(0.1), 1),
        (Told(0.2), Told(0.1, drawable=False), 0),
        (Told(0.02, converged=True), Told(0.01, converged=True), 0),
        (Told(0.02), Told(0.03, converged=True), 1),
        (Told(1.0, drawable=False), Told(1.0, drawable=False), 0),
    ],
)
def test_the_choice(first: Told, second: Told, chosen: int) -> None:
    views = (first, second)
    view = AutoView(((RendererName.INTERPOLANT, first), (RendererName.VPL, second)))
    assert view.chosen[1] is views[chosen]
    assert view.error_estimate == views[chosen].error_estimate
    assert (view.drawable, view.converged) == (views[chosen].drawable, views[chosen].converged)
    assert view.draw()[0, 0, 0] == views[chosen].error_estimate


def test_it_improves_while_any_does() -> None:
    done, works = Told(0.1, improving=False), Told(0.5)
    assert AutoView(((RendererName.VPL, done), (RendererName.PATH, works))).improving
    assert not AutoView(((RendererName.VPL, done),)).improving


def test_a_wait_for_an_error_is_over_when_whoever_is_best_is_there(drawing: Drawing) -> None:
    engine = Engine(box(), LightSettings(error_tolerance=0.02), drawing=drawing)
    wait = Wait(WaitFor.MAX_ERROR, 0.1)
    while not engine.outlook(AUTO).is_worth(wait):
        engine.step(SMALL_STEP)
    assert engine.frame(AUTO).outlook.error_estimate <= 0.1


def test_what_frames_cost_is_told_by_the_latest_but_not_by_luck() -> None:
    times = FrameTimes()
    assert times.expected == 0.0
    for seconds in (0.1, 0.1, 0.02):
        times.learn(seconds)
    assert times.expected == pytest.approx(0.06)
    times.learn(0.2)
    assert times.expected == 0.2
