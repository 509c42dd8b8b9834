"""What an engine shows: frames of every layer and renderer, their limits, and probes."""

from __future__ import annotations

import math

import numpy as np
import pytest

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
from solver.engine.world import World
from solver.errors import LimitExceededError
from solver.illumination.settings import LightSettings
from solver.pathtracing import PathTracer
from solver.types import LUMINANCE_WEIGHTS
from tests.engine.acting import LOOSE, edits, settle
from tests.engine.scenes import box

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
        engine = Engine(box(), LightSettings(error_tolerance=tolerance), drawing=drawing)
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


@pytest.mark.parametrize("layer", [LayerName.TRIANGLE, LayerName.BARYCENTRIC, LayerName.ERROR])
def test_layers_of_interpolants_are_refused_of_other_renderers(settled: Engine, layer: LayerName) -> None:
    for renderer in (RendererName.GOURAUD, RendererName.GATHER, RendererName.VPL):
        with pytest.raises(NotAvailableError) as refused:
            settled.frame(FrameRequest(renderer=renderer, layer=layer))
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
    # Looking down from 10 cm, it sees little but the floor below the lamp.
    world = World.of(settled.scene)
    seen, _ = PathTracer(world.surfaces, world.rays).irradiance(
        positions[1:], np.array([[0.0, 0.0, -1.0]]), 8192
    )
    assert result.irradiance[1] == pytest.approx(seen[0], rel=0.1)
    assert result.revision == 1
    assert np.all(result.error_estimate >= 0.0)


def test_a_probe_of_no_points_is_empty(settled: Engine) -> None:
    result = settled.probe(np.empty((0, 3)), np.empty((0, 3)))
    assert result.irradiance.shape == (0, 3)
