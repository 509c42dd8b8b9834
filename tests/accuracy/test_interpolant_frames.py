"""Frames of interpolants, converged, by default settings, against frames that the project did not compute."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName, Wait, WaitFor
from solver.engine.world import World
from solver.pathtracing import PathTracer
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from tests.engine.acting import settle

REFERENCE = Path(__file__).parents[1] / "data" / "reference"


@dataclass(frozen=True)
class Differences:
    """How a frame differs from a reference over its mask."""

    error: float
    """Relative RMS luminance error, less the reference's noise"""
    p99: float
    """99th percentile of the relative error of a pixel, less two standard errors of the reference"""


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    return Drawing()


def settled(name: str, request: FrameRequest, drawing: Drawing) -> Engine:
    """An engine whose frame of `request` is as good as it gets."""
    engine = Engine(load_sample(name), drawing=drawing)
    engine.outlook(request)
    settle(engine)
    while engine.outlook(request).improving:
        engine.step(0.1)
    assert engine.outlook(request).converged
    return engine


def luminance(engine: Engine, request: FrameRequest) -> FloatArray:
    return np.asarray(engine.frame(request).image @ LUMINANCE_WEIGHTS)


def differences(name: str, camera: str, frame: FloatArray) -> Differences:
    with np.load(REFERENCE / f"{name}.{camera}.luminance.npz") as file:
        truth, noise, mask = file["luminance"], file["standard_error"], file["mask"]
    off, truth, noise = frame[mask] - truth[mask], truth[mask], noise[mask]
    squared = max(0.0, float(np.sum(off**2 - noise**2)) / float(np.sum(truth**2)))
    beyond = np.maximum(np.abs(off) - 2.0 * noise, 0.0) / truth
    return Differences(float(np.sqrt(squared)), float(np.quantile(beyond, 0.99)))


def request_of(name: str, camera: str) -> FrameRequest:
    with np.load(REFERENCE / f"{name}.{camera}.luminance.npz") as file:
        height, width = file["mask"].shape
    return FrameRequest(CameraChoice(camera, width=width, height=height), samples=16)


@pytest.mark.parametrize(
    ("name", "camera"),
    [("cornell", "main"), ("cube_room", "main"), pytest.param("office", "birds_eye", marks=pytest.mark.slow)],
)
def test_frames_are_within_one_percent(name: str, camera: str, drawing: Drawing) -> None:
    request = request_of(name, camera)
    engine = settled(name, request, drawing)
    fine = differences(name, camera, luminance(engine, request))
    coarse = differences(name, camera, luminance(engine, replace(request, renderer=RendererName.GOURAUD)))
    assert fine.error < 0.01
    assert fine.p99 < 0.05
    assert fine.error < 0.5 * coarse.error
    assert fine.error < engine.outlook(request).error_estimate


@pytest.mark.parametrize("renderer", [None, RendererName.AUTO])
@pytest.mark.parametrize("asked", [0.1, 0.05, 0.02])
@pytest.mark.parametrize(
    ("name", "camera"),
    [("cornell", "main"), pytest.param("cube_room", "main", marks=pytest.mark.slow),
     pytest.param("office", "birds_eye", marks=pytest.mark.slow)],
)  # fmt: skip
def test_the_first_frame_within_an_error_is(
    name: str, camera: str, asked: float, renderer: RendererName | None, drawing: Drawing
) -> None:
    """What `wait=max_error` answers with is within that error of the reference."""
    request = replace(request_of(name, camera), renderer=renderer)
    engine, wait = Engine(load_sample(name), drawing=drawing), Wait(WaitFor.MAX_ERROR, asked)
    while not engine.outlook(request).is_worth(wait):
        engine.step(0.02)
    assert engine.outlook(request).error_estimate <= asked
    assert differences(name, camera, luminance(engine, request)).error <= asked


def test_the_edge_of_a_shadow_is_crisp_at_twenty_times_zoom(drawing: Drawing) -> None:
    """Where the short block's shadow falls on the floor: against path tracing at the middles of pixels."""
    scene = load_sample("cornell")
    whole = scene.cameras["main"]
    target = (0.25, 0.0, 0.03)
    choice = CameraChoice(
        "main",
        target=target,
        vertical_fov=2.0 * np.degrees(np.arctan(np.tan(np.radians(whole.vertical_fov) / 2.0) / 20.0)),
        width=24,
        height=24,
    )
    request = FrameRequest(choice)
    engine = settled("cornell", request, drawing)
    world = World.of(scene)
    position, normal = (
        engine.frame(replace(request, layer=layer)).image.reshape(-1, 3).astype(np.float64)
        for layer in (LayerName.POSITION, LayerName.NORMAL)
    )
    truth, noise = PathTracer(world.surfaces, world.rays, 3).irradiance(position, normal, 4096)
    irradiance = engine.frame(replace(request, layer=LayerName.IRRADIANCE)).image.reshape(-1, 3)
    off = (irradiance - truth) @ LUMINANCE_WEIGHTS
    scatter, light = noise @ LUMINANCE_WEIGHTS, truth @ LUMINANCE_WEIGHTS
    assert light.max() > 1.3 * light.min(), "it is the edge of a shadow"
    assert np.sqrt(max(0.0, float(np.sum(off**2 - scatter**2))) / float(np.sum(light**2))) < 0.03
