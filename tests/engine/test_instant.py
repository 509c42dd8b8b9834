"""Frames by virtual lights: how they get better, what they show of edits, and what is kept of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.instant import blocks, frames
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.engine.solution import Solution
from solver.engine.views import InstantView
from solver.errors import LimitExceededError
from solver.illumination.settings import Compensation
from solver.types import LUMINANCE_WEIGHTS, AnyArray, FloatArray
from tests.engine.acting import LOOSE, edits, settle
from tests.engine.scenes import box

QUICK = replace(LOOSE, vpl_resolution=48)
VPL = FrameRequest(renderer=RendererName.VPL)
LAYERS = (LayerName.RADIANCE, LayerName.IRRADIANCE, LayerName.ILLUMINANCE, LayerName.FALSE_COLOUR)
FLOOR = (44, 4)
"""A pixel of the box that shows a corner of the floor."""


@pytest.fixture(autouse=True)
def unsolved(monkeypatch: pytest.MonkeyPatch) -> None:
    """No solve gets on: virtual lights need none."""
    monkeypatch.setattr(Solution, "step", lambda *_: None)


@pytest.fixture
def instant(drawing: Drawing) -> Engine:
    return Engine(box(), QUICK, drawing=drawing)


def paths(engine: Engine, count: int, request: FrameRequest = VPL) -> FloatArray:
    """Radiance once `count` paths of the scene as it stands are in the frame."""
    view = engine._view(request)
    assert isinstance(view, InstantView)
    frame = view.asked.frame
    while frame.paths < count:
        frame.step()
    return engine.frame(request).image.astype(np.float64)


def until(engine: Engine, request: FrameRequest, is_over: Callable[[], bool]) -> AnyArray:
    while not is_over():
        engine.step(0.02)
    return engine.frame(request).image


def rest(engine: Engine, request: FrameRequest = VPL) -> None:
    """Work until the frame is as good as asked."""
    while engine.outlook(request).improving:
        engine.step(0.05)


def works(engine: Engine) -> bool:
    """Whether any frame needs work."""
    assert engine._showing.instant is not None
    return engine._showing.instant.step(0.01, engine.settings.error_tolerance)


def luminance(image: AnyArray) -> FloatArray:
    return np.asarray(image.astype(np.float64) @ LUMINANCE_WEIGHTS)


def difference(image: FloatArray, truth: FloatArray) -> float:
    """Relative RMS of luminance."""
    off, norm = luminance(image - truth), luminance(truth)
    return float(np.sqrt(np.sum(off**2) / np.sum(norm**2)))


# --- getting better ---


def test_a_first_frame_needs_no_solve(instant: Engine) -> None:
    first = instant.outlook(VPL)
    assert (first.drawable, first.converged, first.improving) == (False, False, True)
    assert first.error_estimate == 1.0
    image = until(instant, VPL, lambda: instant.outlook(VPL).drawable)
    assert instant.status().progress == 0.0, "nothing is solved"
    assert image.shape == (48, 48, 3)
    assert np.all(np.isfinite(image))
    assert np.mean(luminance(image) > 0.0) > 0.8
    assert not instant.outlook(VPL).converged


def test_frames_converge_and_then_rest(instant: Engine) -> None:
    rest(instant)
    outlook = instant.outlook(VPL)
    assert (outlook.drawable, outlook.converged, outlook.improving) == (True, True, False)
    assert 0.0 < outlook.error_estimate <= QUICK.error_tolerance
    assert outlook.renderer is RendererName.VPL
    tag = outlook.tag
    assert not works(instant)
    assert instant.outlook(VPL).tag == tag
    # Who needs less error gets it.
    better = replace(VPL, max_error=0.5 * outlook.error_estimate)
    assert instant.outlook(better).improving
    rest(instant, better)
    assert instant.outlook(better).error_estimate <= better.max_error
    assert instant.outlook(better).tag != tag


@pytest.mark.parametrize("samples", [1, 4, 16])
def test_the_estimate_is_about_the_error(drawing: Drawing, samples: int) -> None:
    """Against frames of eight times as many paths at least; of colours that are reflected alone.

    The estimate is to be no less than the error in most scenes (`spread.SAFETY`), and so is more in these.
    """
    ratios = []
    for scene, size in ((box(), 32), (load_sample("cornell"), 24)):
        engine = Engine(scene, replace(QUICK, vpl_resolution=24), drawing=drawing)
        camera = CameraChoice("main", width=size, height=size)
        request = FrameRequest(camera, RendererName.VPL, samples=samples)
        shots = [(paths(engine, n, request), engine.outlook(request).error_estimate) for n in (64, 128, 1024)]
        truth = shots[-1][0]
        lamp = luminance(truth) > 0.5 * luminance(truth).max()
        assert lamp.mean() < 0.1 or scene.name == "box"
        for image, estimate in shots[:2]:
            seen = np.ones_like(lamp) if scene.name == "box" else ~lamp
            ratios.append(difference(image[seen], truth[seen]) / estimate)
    assert max(ratios) < 1.0, ratios
    assert min(ratios) > 0.2, ratios


def test_errors_fall_as_paths_grow(instant: Engine) -> None:
    shots = {n: paths(instant, n) for n in (8, 64, 256, 2048)}
    errors = [difference(shots[n], shots[2048]) for n in (8, 64, 256)]
    assert errors == sorted(errors, reverse=True)
    assert errors[2] < 0.5 * errors[0]


def test_paths_have_a_limit(drawing: Drawing) -> None:
    engine = Engine(box(), replace(QUICK, max_paths=64, error_tolerance=1e-5), drawing=drawing)
    rest(engine)
    outlook = engine.outlook(VPL)
    assert (outlook.improving, outlook.converged) == (False, False)
    assert outlook.error_estimate > 1e-5


def test_what_nobody_asks_for_is_not_worked_on(instant: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames, "INTEREST", 0.0)
    instant.outlook(VPL)
    assert not works(instant)
    monkeypatch.setattr(frames, "INTEREST", 60.0)
    instant.outlook(VPL)
    assert works(instant)


# --- what is shown ---


@pytest.mark.parametrize("layer", LAYERS)
def test_layers(instant: Engine, layer: LayerName) -> None:
    radiance = paths(instant, 64)
    image = instant.frame(replace(VPL, layer=layer)).image
    irradiance = instant.frame(replace(VPL, layer=LayerName.IRRADIANCE)).image
    assert image.shape == ((48, 48) if layer is LayerName.ILLUMINANCE else (48, 48, 3))
    match layer:
        case LayerName.RADIANCE:
            floor = np.array([0.6, 0.4, 0.2]) * irradiance[FLOOR] / np.pi
            np.testing.assert_allclose(radiance[FLOOR], floor, rtol=1e-5)
        case LayerName.ILLUMINANCE:
            np.testing.assert_allclose(image, 179.0 * luminance(irradiance), rtol=1e-5)
        case _:
            assert np.all(image[FLOOR] > 0.0)


def test_lamps_are_seen_as_they_shine(instant: Engine) -> None:
    """From below and aside; and what is seen beside all surfaces is black."""
    at_lamp = FrameRequest(
        CameraChoice(eye=(0, 0, 0.1), target=(0.0, 0.0, 2.0), up=(0, 1, 0), width=20, height=20),
        renderer=RendererName.VPL,
    )
    image = paths(instant, 8, at_lamp)
    np.testing.assert_allclose(image[10, 10], np.array([10.0, 10.0, 8.0]) / np.pi, rtol=1e-6)
    assert not image[0, 0].any()


@pytest.mark.parametrize("samples", [2, 5, 16])
def test_samples_smooth_edges_and_keep_the_light(instant: Engine, samples: int) -> None:
    once = paths(instant, 512)
    often = paths(instant, 512, replace(VPL, samples=samples))
    assert luminance(often).mean() == pytest.approx(luminance(once).mean(), rel=0.03)
    assert difference(often, once) < 0.15


def test_samples_have_a_limit(instant: Engine) -> None:
    with pytest.raises(LimitExceededError) as refused:
        instant.frame(replace(VPL, samples=frames.MOST_SAMPLES + 1))
    assert refused.value.what == "samples"


# --- settings ---


def corner_frames(drawing: Drawing, count: int = 512, **changes: float | Compensation) -> FloatArray:
    """A small view of cornell."""
    settings = replace(LOOSE, vpl_resolution=32, **changes)  # type: ignore[arg-type]
    engine = Engine(load_sample("cornell"), settings, drawing=drawing)
    return paths(engine, count, replace(VPL, camera=CameraChoice(width=32, height=32)))


def test_what_the_bound_takes_away_is_put_back(drawing: Drawing) -> None:
    """Without compensation corners are darker; without a bound there is nothing to compensate."""
    whole, none = corner_frames(drawing), corner_frames(drawing, vpl_compensation=Compensation.NONE)
    unbounded, wide = corner_frames(drawing, vpl_reach=0.0), corner_frames(drawing, vpl_reach=0.3)
    mean = luminance(whole).mean()
    assert luminance(unbounded).mean() == pytest.approx(mean, rel=0.02)
    assert luminance(wide).mean() == pytest.approx(mean, rel=0.02)
    assert difference(wide, whole) < 0.06
    # The lights are the same: what is missing is what was put back, along the edges of the back wall.
    missing = luminance(whole - none) / luminance(whole + 1e-9)
    assert missing.min() >= -1e-6
    assert missing[6:9, 8:24].mean() > 0.05, "where it meets the ceiling"
    assert missing[26:28, 4:24].mean() > 0.2, "where floor and block meet"
    assert missing[10:15, 12:22].mean() < 0.02, "in its middle"


def test_a_solution_may_tell_nearby_light(drawing: Drawing, monkeypatch: pytest.MonkeyPatch) -> None:
    """As soon as there is one; until then, rays tell."""
    monkeypatch.undo()
    found = []
    for compensation in (Compensation.RAYS, Compensation.SOLUTION):
        engine = Engine(box(), replace(QUICK, vpl_compensation=compensation), drawing=drawing)
        settle(engine)
        while engine._showing.known_light() is None:
            engine.step(0.05)
        found.append(paths(engine, 1024))
    assert not np.array_equal(found[0], found[1])
    assert difference(found[1], found[0]) < 0.01


def test_settings_of_lights_make_a_new_frame(instant: Engine) -> None:
    before = paths(instant, 64)
    instant.configure(replace(QUICK, vpl_reach=0.05))
    assert not instant.outlook(VPL).drawable
    assert not np.array_equal(paths(instant, 64), before)


# --- what is kept ---


def test_each_camera_has_its_frame(instant: Engine) -> None:
    side = replace(VPL, camera=CameraChoice("side"))
    first, other = paths(instant, 64), paths(instant, 32, side)
    assert (first.shape, other.shape) == ((48, 48, 3), (24, 32, 3))
    np.testing.assert_array_equal(instant.frame(VPL).image, first.astype(np.float32))
    np.testing.assert_array_equal(instant.frame(side).image, other.astype(np.float32))


def test_the_frame_asked_for_longest_ago_makes_room(instant: Engine) -> None:
    views = [replace(VPL, camera=CameraChoice(eye=(0.0, 0.0, 1.5 + 0.1 * k))) for k in range(5)]
    for view in views:
        paths(instant, 8, view)
    assert [instant.outlook(view).drawable for view in reversed(views[1:])] == [True] * 4
    assert not instant.outlook(views[0]).drawable


def test_few_points_are_kept_at_once(instant: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames, "MOST_POINTS", 3000)
    near = replace(VPL, camera=CameraChoice(eye=(0.0, 0.0, 1.5)))
    paths(instant, 8)
    paths(instant, 8, near)
    assert instant.outlook(near).drawable
    assert not instant.outlook(VPL).drawable, "2304 points each are too many"


def test_a_camera_that_sees_nothing_has_a_black_frame(instant: Engine) -> None:
    away = replace(VPL, camera=CameraChoice(eye=(0, 0, 9), target=(0, 0, 10), up=(0, 1, 0)))
    assert not paths(instant, 64, away).any()
    assert instant.outlook(away).error_estimate == 0.0
    instant.apply(edits({"op": "move", "id": "crate", "transform": {"translation": [0, 0, 9.5]}}))
    assert paths(instant, 8, away).shape == (48, 48, 3)


def test_a_scene_without_lamps_is_dark(drawing: Drawing) -> None:
    engine = Engine(box().without_object("lamp"), QUICK, drawing=drawing)
    assert not paths(engine, 64).any()
    assert engine.outlook(VPL).converged


@pytest.mark.parametrize("limit", [1, 300_000])
def test_little_memory_costs_time_only(drawing: Drawing, monkeypatch: pytest.MonkeyPatch, limit: int) -> None:
    whole = paths(Engine(box(), QUICK, drawing=drawing), 256)
    monkeypatch.setattr(blocks, "SIGHT_BYTES", limit)
    engine = Engine(box(), QUICK, drawing=drawing)
    found = paths(engine, 256)
    assert engine._showing.instant is not None
    assert engine._showing.instant._blocks._bytes <= limit
    if limit == 1:
        np.testing.assert_array_equal(found, whole)
    # Lights that are kept stand in where rays to what is near end.
    assert difference(found, whole) < 0.02
