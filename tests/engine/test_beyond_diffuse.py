"""Scenes that are not diffuse: paths show all of them, radiosity what is diffuse, and the status says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver.document.conversion import scene_of
from solver.document.models import SceneDocument
from solver.engine import solution
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.geometry.scene import Scene
from solver.types import AnyArray
from tests.engine.acting import LOOSE, edits, settle
from tests.engine.scenes import box_document

FLOOR, LAMP = 0, 1
SPECULAR, DIRECTED = "specular reflection", "directional emission"


def box_with(changes: dict[int, dict[str, Any]]) -> Scene:
    document = box_document()
    for index, material in changes.items():
        document["objects"][index]["material"].update(material)
    return scene_of(SceneDocument.model_validate(document))


MIRROR = {FLOOR: {"reflectance": [0.1, 0.1, 0.1], "specular": [0.8, 0.5, 0.2]}}
SPOT = {LAMP: {"emission_exponent": 20}}


def told(engine: Engine) -> tuple[bool, bool]:
    """Whether one warning speaks of specular reflection, and of directional emission."""
    warnings = [warning for warning in engine.status().warnings if SPECULAR in warning or DIRECTED in warning]
    assert len(warnings) <= 1 and all("renderer path" in warning for warning in warnings)
    return any(SPECULAR in warning for warning in warnings), any(DIRECTED in warning for warning in warnings)


@pytest.mark.parametrize("most_linked", [3000, 2])
def test_the_status_tells_what_radiosity_leaves_out(
    drawing: Drawing, monkeypatch: pytest.MonkeyPatch, most_linked: int
) -> None:
    """Of that and no more, whether light is linked or sampled, from the first and until it is edited away."""
    monkeypatch.setattr(solution, "MOST_LINKED", most_linked)
    cases: list[tuple[dict[int, dict[str, Any]], tuple[bool, bool]]] = [
        ({}, (False, False)),
        ({FLOOR: {"exponent": 20}}, (False, False)),
        (MIRROR, (True, False)),
        (SPOT, (False, True)),
        (MIRROR | SPOT, (True, True)),
    ]
    for changes, expected in cases:
        assert told(Engine(box_with(changes), LOOSE, drawing=drawing)) == expected
    engine = Engine(box_with(MIRROR | SPOT), LOOSE, drawing=drawing)
    engine.apply(edits({"op": "remove", "id": "floor"}))
    assert told(engine) == (False, True)


def seen(engine: Engine, renderer: RendererName) -> AnyArray:
    """Radiance in the middle of the picture."""
    request = FrameRequest(CameraChoice(width=9, height=9), renderer, samples=4)
    while not engine.outlook(request).converged:
        assert engine.step(0.1)
    return np.asarray(engine.frame(request).image[4, 4])


def test_paths_show_the_lamp_in_a_mirror_as_soon_as_it_is_one(drawing: Drawing) -> None:
    engine = Engine(box_with({}), LOOSE, drawing=drawing)
    lamp = np.array([10.0, 10.0, 8.0]) / np.pi
    before = seen(engine, RendererName.PATH)
    assert np.all(before < 0.3 * lamp)
    specular = [0.8, 0.5, 0.2]
    mirror = {"reflectance": [0, 0, 0], "specular": specular}
    engine.apply(edits({"op": "set_material", "id": "floor", "material": mirror}))
    np.testing.assert_allclose(seen(engine, RendererName.PATH), lamp * specular, rtol=1e-5)


def test_radiosity_is_that_of_the_diffuse_part(drawing: Drawing) -> None:
    engines = [
        Engine(box_with({FLOOR: {"reflectance": [0.1, 0.1, 0.1]}} | extra), LOOSE, drawing=drawing)
        for extra in ({}, MIRROR | SPOT)
    ]
    for engine in engines:
        settle(engine)
    frames = [engine.frame(FrameRequest(renderer=RendererName.FLAT)).image for engine in engines]
    np.testing.assert_allclose(frames[1], frames[0], rtol=1e-4)
