"""Views that come while elements are subdivided: each is told its error, whatever the tree has become."""

from __future__ import annotations

from solver.document.samples import load_sample
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.illumination.settings import LightSettings


def test_each_step_may_be_seen_by_another_camera() -> None:
    engine = Engine(load_sample("cornell"), LightSettings(error_tolerance=0.01))
    looks = 0
    while engine.step(0.005) and looks < 150:
        camera = CameraChoice(width=32, height=24, vertical_fov=30.0 + 0.1 * looks)
        outlook = engine.outlook(FrameRequest(camera, RendererName.FLAT))
        assert 0.0 < outlook.error_estimate <= 1.0
        looks += 1
    assert looks > 10
