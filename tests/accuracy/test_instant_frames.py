"""Frames by virtual lights against frames that the project did not compute, and its other renderers'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.instant import blocks
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.engine.solution import Solution
from solver.engine.views import InstantView, PathView
from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.path_numbers import PathPoints
from solver.illumination.particles.thinning import PATHS
from solver.illumination.particles.walk import ParticleWalk, WalkSettings
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS, BoolArray, FloatArray
from solver.visibility.rays import RayScene
from tests.accuracy.test_interpolant_frames import differences, drawing, luminance, request_of

__all__ = ["drawing"]

_FINE = 8
"""Places along a side of a pixel that tell what it shows"""

ENDLESS = LightSettings(error_tolerance=1e-4)


def refine(engine: Engine, request: FrameRequest, paths: int) -> float:
    """Work until the frame is of `paths` paths; its error estimate."""
    view = engine._view(request)
    assert isinstance(view, InstantView)
    while view.asked.frame.paths < paths:
        view.asked.frame.step()
    return view.error_estimate


# --- against references ---


@pytest.mark.parametrize(
    ("name", "camera", "most"),
    [("cornell", "main", 0.12), ("cube_room", "main", 0.05), ("office", "birds_eye", 0.075)],
)
def test_frames_of_a_hundred_paths_are_rough(name: str, camera: str, most: float, drawing: Drawing) -> None:
    request = replace(request_of(name, camera), renderer=RendererName.VPL, samples=4)
    engine = Engine(load_sample(name), replace(ENDLESS, vpl_resolution=64), drawing=drawing)
    estimate = refine(engine, request, 128)
    error = differences(name, camera, luminance(engine, request)).error
    assert error < most
    assert 0.5 * error < estimate < 2.0 * error


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "camera"), [("cornell", "main"), ("cube_room", "main"), ("office", "birds_eye")]
)
def test_frames_of_2048_paths_are_within_one_and_a_half_percent(
    name: str, camera: str, drawing: Drawing
) -> None:
    request = replace(request_of(name, camera), renderer=RendererName.VPL, samples=4)
    engine = Engine(load_sample(name), ENDLESS, drawing=drawing)
    estimate = refine(engine, request, 2048)
    assert engine.status().progress == 0.0, "nothing was solved"
    found = differences(name, camera, luminance(engine, request))
    assert found.error < 0.015
    assert 0.5 * found.error < estimate < 2.0 * found.error


def errors_of(points: PathPoints, thinned_from: int, drawing: Drawing) -> list[float]:
    """Of cornell, for 32, 64, ... paths."""
    with pytest.MonkeyPatch.context() as patch:

        def walk(surfaces: Surfaces, rays: RayScene) -> ParticleWalk:
            return ParticleWalk(surfaces, rays, WalkSettings(points))

        patch.setattr(blocks, "PATHS", thinned_from)
        patch.setattr(blocks, "ParticleWalk", walk)
        engine = Engine(load_sample("cornell"), replace(ENDLESS, vpl_resolution=48), drawing=drawing)
        request = replace(request_of("cornell", "main"), renderer=RendererName.VPL, samples=1)
        found = []
        paths = 32
        while paths <= 2048:
            refine(engine, request, paths)
            found.append(differences("cornell", "main", luminance(engine, request)).error)
            paths *= 2
    return found


def slope(errors: list[float]) -> float:
    """Of the logarithm of errors over that of paths."""
    return float(np.polyfit(np.log(2.0) * np.arange(len(errors)), np.log(errors), 1)[0])


@pytest.mark.slow
def test_errors_fall_faster_than_by_chance(drawing: Drawing) -> None:
    """Than N^-1/2, which plain random walks have: [K 3.1] and what thinning adds to it."""
    even = errors_of(PathPoints.SCRAMBLED, PATHS, drawing)
    chance = errors_of(PathPoints.RANDOM, 1, drawing)
    assert slope(even) < -0.55, even
    assert slope(even) < slope(chance) - 0.05, (even, chance)
    assert all(a < b for a, b in zip(even, chance, strict=True)), (even, chance)
    assert even[-1] < 0.6 * chance[-1]


# --- against each other ---


def whole_planes(engine: Engine, request: FrameRequest) -> BoolArray:
    """Pixels (h, w) whose whole footprint shows one plane of something that does not emit."""
    assert request.camera.width is not None
    assert request.camera.height is not None
    fine = replace(request.camera, width=_FINE * request.camera.width, height=_FINE * request.camera.height)
    told: list[FloatArray] = []
    for layer in (LayerName.OBJECT, LayerName.NORMAL):
        image = engine.frame(FrameRequest(fine, RendererName.FLAT, layer)).image
        told.append(image.reshape(*image.shape[:2], -1).astype(float))
    marks = np.concatenate(told, axis=2)
    h, w = request.camera.height, request.camera.width
    cells = marks.reshape(h, _FINE, w, _FINE, -1).swapaxes(1, 2).reshape(h, w, _FINE**2, -1)
    lamps = [k for k, o in enumerate(engine.scene) if np.any(o.material.emission > 0.0)]
    one = np.ptp(cells, axis=2).max(axis=2) < 1e-6
    # Corners of lamps are thin: none is in a pixel beside one either.
    lit = np.pad(np.isin(cells[..., 0], lamps).any(axis=2), 1)
    beside = np.any([lit[i : i + h, j : j + w] for i in range(3) for j in range(3)], axis=0)
    return np.asarray(one & (cells[:, :, 0, 0] >= 0.0) & ~beside)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell", "cube_room", "office", "robot_cell"])
def test_renderers_agree(name: str, drawing: Drawing) -> None:
    """Virtual lights, interpolants and traced paths, all of this project, share little but the scene."""
    engine = Engine(load_sample(name), LightSettings(), drawing=drawing)
    request = FrameRequest(CameraChoice("main", width=40, height=30), samples=16)
    mask = whole_planes(engine, request)
    assert mask.mean() > 0.25
    found: dict[RendererName, FloatArray] = {}
    for renderer, error in (
        (RendererName.VPL, 0.012),
        (RendererName.INTERPOLANT, np.inf),
        (RendererName.PATH, 0.016),
    ):
        asked = replace(request, renderer=renderer, max_error=error)
        while engine.outlook(asked).improving:
            engine.step(0.2)
        found[renderer] = luminance(engine, asked)[mask]
    traced = engine._view(asked)
    assert isinstance(traced, PathView)
    # Channels share their paths, so that their noise adds up by amplitude.
    noise = float(np.mean((traced.asked.frame.standard_error[mask] @ LUMINANCE_WEIGHTS) ** 2))
    norm = float(np.mean(found[RendererName.PATH] ** 2))
    for a, b, scatter in (
        (RendererName.VPL, RendererName.PATH, noise),
        (RendererName.INTERPOLANT, RendererName.PATH, noise),
        (RendererName.VPL, RendererName.INTERPOLANT, 0.0),
    ):
        squared = float(np.mean((found[a] - found[b]) ** 2)) - scatter
        assert np.sqrt(max(0.0, squared) / norm) < 0.02, (a, b)


def test_nothing_is_solved_for_virtual_lights(drawing: Drawing, monkeypatch: pytest.MonkeyPatch) -> None:
    """A first frame of the largest sample is there long before a solve is."""
    monkeypatch.setattr(Solution, "step", lambda *_: None)
    engine = Engine(load_sample("robot_cell"), LightSettings(), drawing=drawing)
    request = FrameRequest(CameraChoice("main", width=80, height=60), RendererName.VPL)
    refine(engine, request, 8)
    assert engine.outlook(request).drawable
    assert np.mean(luminance(engine, request) > 0.0) > 0.95
