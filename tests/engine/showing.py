"""A settled session with everything in it that overlays can show, and how they are shown."""

from __future__ import annotations

from typing import Any

import numpy as np

from solver.document.conversion import scene_of
from solver.document.models import SceneDocument
from solver.engine.engine import Engine
from solver.engine.overlays.base import Column, Overlay, OverlayRequest, Shown
from solver.engine.requests import CameraChoice
from solver.geometry.scene import Scene
from solver.types import AnyArray
from tests.engine.scenes import box_document


def room_document() -> dict[str, Any]:
    """The box with a two-sided screen that stands on its floor, and a triangle through the crate's plane."""
    document = box_document()
    document["objects"] += [
        {
            "id": "screen",
            "mesh": {
                "vertices": [[-0.6, -0.4, 0], [0.1, -0.4, 0], [0.1, -0.4, 0.6], [-0.6, -0.4, 0.6]],
                "faces": [[0, 1, 2, 3]],
            },
            "material": {"reflectance": [0.3, 0.5, 0.7], "two_sided": True},
        },
        {
            "id": "shard",
            "mesh": {
                "vertices": [[-0.6, 0.2, 0.3], [-0.1, 0.2, 0.8], [-0.6, 0.7, 0.7]],
                "faces": [[0, 1, 2]],
            },
            "material": {"reflectance": [0.5, 0.2, 0.5]},
        },
    ]
    return document


def room() -> Scene:
    """The scene of `room_document`."""
    return scene_of(SceneDocument.model_validate(room_document()))


def show(engine: Engine, overlay: Overlay, complete: bool = True) -> Shown:
    """The overlay, once it is ready."""
    request = OverlayRequest(overlay, CameraChoice(), complete)
    while not engine.is_overlay_ready(request, complete):
        assert engine.step(0.1), "what is missing is worked on"
    work = engine.overlay(request)
    while True:
        try:
            next(work)
        except StopIteration as end:
            shown: Shown = end.value
            break
    assert len({len(column) for column in shown.columns.values()}) == 1
    return shown


def columns_of(shown: Shown) -> dict[str, AnyArray]:
    """The columns as arrays: of objects where there may be None, or lists of different lengths."""
    return {name: _array(column) for name, column in shown.columns.items()}


def table(engine: Engine, overlay: Overlay) -> dict[str, AnyArray]:
    """The columns of a complete overlay."""
    return columns_of(show(engine, overlay))


def _array(column: Column) -> AnyArray:
    try:
        return np.array(column)
    except ValueError:
        ragged = np.empty(len(column), dtype=object)
        ragged[:] = list(column)
        return ragged
