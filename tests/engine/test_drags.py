"""Frames in the midst of a drag: light goes on while they are drawn."""

from __future__ import annotations

from solver.document.edits import MoveEdit
from solver.document.models import TransformDocument
from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.engine.status import SessionState
from solver.illumination.settings import LightSettings
from tests.engine.acting import settle

REQUEST = FrameRequest(CameraChoice(width=640, height=480), RendererName.GOURAUD)


def move(x: float) -> MoveEdit:
    return MoveEdit(op="move", id="short_block", transform=TransformDocument(translation=[x, 0.0, 0.0]))


def test_light_goes_on_while_a_frame_is_drawn(drawing: Drawing) -> None:
    engine = Engine(load_sample("cornell"), LightSettings(error_tolerance=0.02), drawing=drawing)
    settle(engine)
    engine.frame(REQUEST)
    for k, drags in ((1, False), (2, True), (3, True)):
        engine.apply([move(0.01 * k)])
        first = engine.outlook(REQUEST)
        if engine.status().state is not SessionState.SOLVING:
            continue
        frame = engine.frame(REQUEST)
        after = engine.outlook(REQUEST)
        assert frame.outlook == first, "the frame is told as it was when it was begun"
        assert (after.tag != first.tag) == drags
        assert frame.image.max() > 0.0
    settle(engine)
    assert engine.status().state is SessionState.CONVERGED
