"""Interpolants after an edit: what it leaves alone is taken over, and right."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS, FloatArray
from tests.engine.acting import edits
from tests.engine.scenes import furnished

SETTINGS = LightSettings(error_tolerance=0.02)
REQUEST = FrameRequest(
    CameraChoice(width=96, height=72), RendererName.INTERPOLANT, LayerName.IRRADIANCE
)  # fmt: skip


def shown(engine: Engine) -> FloatArray:
    """Luminance irradiance of a converged frame, W/m2."""
    while not engine.outlook(REQUEST).converged:
        engine.step(0.05)
    return np.asarray(engine.frame(REQUEST).image, dtype=np.float64)[..., :3] @ LUMINANCE_WEIGHTS


def after(edit: dict[str, Any], drawing: Drawing, work: int | None = None) -> tuple[Engine, Engine]:
    """A session that was looked at before its edit, and one that knows the edited scene alone."""
    engine = Engine(furnished(), SETTINGS, drawing=drawing)
    shown(engine)
    engine.apply(edits(edit))
    if work is not None:
        for _ in range(work):
            engine.step(0.0)
        engine.apply(edits(edit | {"transform": {"translation": [2.7, 1.9, 0.0]}}))
    return engine, Engine(engine.scene, SETTINGS, drawing=drawing)


@pytest.fixture(scope="module")
def drawing() -> Drawing:
    return Drawing()


@pytest.mark.parametrize("work", [None, 3], ids=["settled", "interrupted"])
def test_what_an_edit_leaves_alone_is_taken_over(drawing: Drawing, work: int | None) -> None:
    move = {"op": "move", "id": "a", "transform": {"translation": [2.65, 1.9, 0.0]}}
    engine, anew = after(move, drawing, work)
    found, expected = shown(engine), shown(anew)
    kept, fresh = engine.status().fine, anew.status().fine
    assert kept.taken_over > 0.3 * fresh.point_irradiances
    assert kept.point_irradiances < 0.7 * fresh.point_irradiances
    assert fresh.taken_over == 0
    off = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
    assert off < engine.outlook(REQUEST).error_estimate


def test_where_light_changes_much_nothing_is_taken_over(drawing: Drawing) -> None:
    lamp = {"op": "set_material", "id": "lamp", "material": {"emission": [30.0] * 3}}
    engine, anew = after(lamp, drawing)
    found, expected = shown(engine), shown(anew)
    assert engine.status().fine.taken_over == 0
    off = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
    assert off < engine.outlook(REQUEST).error_estimate


def test_many_small_steps_are_not_trusted_for_ever(drawing: Drawing) -> None:
    """Each changes little; together they are too much for what was seen before the first."""
    engine = Engine(furnished(), SETTINGS, drawing=drawing)
    shown(engine)
    computed = []
    for step in range(1, 7):
        watts = 10.0 * 1.03**step
        lamp = {"op": "set_material", "id": "lamp", "material": {"emission": [watts] * 3}}
        engine.apply(edits(lamp))
        shown(engine)
        computed.append(engine.status().fine.point_irradiances)
    assert min(computed) < 0.5 * max(computed), "some steps are taken over"
    assert max(computed[2:]) > 2 * min(computed), "and then all is looked at again"
