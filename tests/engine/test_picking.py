"""What a pixel shows, against the layers of the frame."""

from __future__ import annotations

import math

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.overlays.triangles import TriangulationOverlay
from solver.engine.requests import CameraChoice, FrameLimits, FrameRequest, LayerName, RendererName
from solver.errors import LimitExceededError, SceneError, UnknownCameraError
from solver.geometry.surfaces import flatten
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS, AnyArray
from tests.engine.acting import settle
from tests.engine.showing import room, show

SURFACES = flatten(room())
SIDE = CameraChoice(name="side")
BELOW = CameraChoice(eye=(0.3, 0.2, -3.0), up=(0.0, 1.0, 0.0))


def layers(engine: Engine, camera: CameraChoice, renderer: RendererName) -> dict[LayerName, AnyArray]:
    wanted = (
        LayerName.RADIANCE, LayerName.IRRADIANCE, LayerName.ILLUMINANCE, LayerName.DEPTH, LayerName.POSITION,
        LayerName.NORMAL, LayerName.OBJECT, LayerName.ELEMENT,
    )  # fmt: skip
    return {name: engine.frame(FrameRequest(camera, renderer, name)).image for name in wanted}


def check(engine: Engine, camera: CameraChoice, renderer: RendererName) -> tuple[int, int, int]:
    """Hold the picks of some pixels to the frame's layers; how many show nothing, a front, a back."""
    shown = layers(engine, camera, renderer)
    height, width = shown[LayerName.DEPTH].shape
    counts = [0, 0, 0]
    for x, y in np.random.default_rng(1).integers(0, (width, height), (150, 2)).tolist():
        result = engine.pick(camera, x, y)
        assert result.revision == 1
        point = result.point
        at = {name: image[y, x] for name, image in shown.items()}
        if point is None:
            assert at[LayerName.OBJECT] == -1
            counts[0] += 1
            continue
        seen = point.seen
        counts[1 if point.front else 2] += 1
        assert seen.object_id == SURFACES.object_ids[at[LayerName.OBJECT]]
        assert seen.leaf == at[LayerName.ELEMENT]
        np.testing.assert_allclose(seen.position, at[LayerName.POSITION], atol=1e-12)
        np.testing.assert_allclose(seen.normal, at[LayerName.NORMAL], atol=1e-6)
        assert point.depth == pytest.approx(at[LayerName.DEPTH], rel=1e-6)
        np.testing.assert_allclose(point.irradiance, at[LayerName.IRRADIANCE], rtol=2e-3, atol=1e-4)
        np.testing.assert_allclose(point.radiosity / math.pi, at[LayerName.RADIANCE], rtol=2e-3, atol=1e-4)
        assert point.illuminance == pytest.approx(179.0 * point.irradiance @ LUMINANCE_WEIGHTS)
        assert point.illuminance == pytest.approx(at[LayerName.ILLUMINANCE], rel=2e-3, abs=2e-2)
    return counts[0], counts[1], counts[2]


def test_picks_are_what_frames_show(drawing: Drawing) -> None:
    engine = Engine(room(), LightSettings(error_tolerance=0.04), drawing=drawing)
    settle(engine)
    found = np.zeros(3, dtype=int)
    for camera in (CameraChoice(), SIDE, BELOW):
        found += check(engine, camera, RendererName.GOURAUD)
    assert found.min() > 5, "nothing, fronts and backs are seen"
    point = engine.pick(CameraChoice(), 5, 40).point
    assert point is not None and not point.has_interpolant

    show(engine, TriangulationOverlay())
    for camera in (CameraChoice(), SIDE, BELOW):
        check(engine, camera, RendererName.INTERPOLANT)
        triangles = engine.frame(FrameRequest(camera, RendererName.INTERPOLANT, LayerName.TRIANGLE)).image
        weights = engine.frame(FrameRequest(camera, RendererName.INTERPOLANT, LayerName.BARYCENTRIC)).image
        y, x = np.argwhere(triangles >= 0)[0].tolist()
        point = engine.pick(camera, x, y).point
        assert point is not None and point.has_interpolant
        assert point.seen.triangle == triangles[y, x]
        np.testing.assert_allclose(point.seen.barycentric, weights[y, x], atol=1e-6)


def test_elements_are_those_of_the_hierarchy(engine: Engine) -> None:
    settle(engine)
    point = engine.pick(CameraChoice(), 5, 40).point
    assert point is not None
    tree = engine._solution.solver.state.tree
    assert tree.child[point.element] < 0
    assert tree.patch[point.element] == point.seen.patch


@pytest.mark.parametrize(("x", "y", "name"), [(48, 0, "x"), (0, 48, "y"), (-1, 0, "x")])
def test_pixels_outside_the_frame_are_named(engine: Engine, x: int, y: int, name: str) -> None:
    with pytest.raises(SceneError) as refused:
        engine.pick(CameraChoice(), x, y)
    assert refused.value.location == (name,)


def test_a_pick_needs_a_camera_within_the_limits(drawing: Drawing) -> None:
    engine = Engine(room(), drawing=drawing, frame_limits=FrameLimits(max_width=64))
    with pytest.raises(UnknownCameraError):
        engine.pick(CameraChoice(name="nope"), 0, 0)
    with pytest.raises(LimitExceededError):
        engine.pick(CameraChoice(width=65), 0, 0)
