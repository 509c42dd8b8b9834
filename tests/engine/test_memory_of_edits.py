"""A session that is edited for long holds no more than one that is edited for a while, its history apart."""

from __future__ import annotations

import gc
import sys

import numpy as np
import pytest

from solver.engine import change_log, history
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest
from solver.illumination.settings import LightSettings
from solver.redistribution import memory
from tests.engine.acting import edits, settle
from tests.engine.scenes import box

REMEMBERED = 20
"""Batches and entries of the log, of which there are a thousand and more otherwise"""


def edit(engine: Engine, random: np.random.Generator, count: int) -> int:
    """Edit and look so many times; how many blocks of memory Python objects take afterwards."""
    for number in range(count):
        place = random.uniform(-0.5, 0.5, 3).tolist()
        grey = [float(random.uniform(0.1, 0.8))] * 3
        engine.apply(edits({"op": "move", "id": "crate", "transform": {"translation": place}}))
        engine.apply(edits({"op": "set_material", "id": "floor", "material": {"reflectance": grey}}))
        if number % 4 == 0:
            engine.undo()
        fov = float(random.uniform(30.0, 60.0))
        engine.frame(FrameRequest(CameraChoice(width=16, height=12, vertical_fov=fov)))
    settle(engine)
    gc.collect()
    return sys.getallocatedblocks()


def test_objects_do_not_grow_in_number_with_edits(monkeypatch: pytest.MonkeyPatch) -> None:
    for kept in (history, change_log):
        monkeypatch.setattr(kept, "KEPT", REMEMBERED)
    monkeypatch.setattr(memory, "COUNT", 1)
    engine = Engine(box(), LightSettings(error_tolerance=0.2), drawing=Drawing())
    random = np.random.default_rng(1)
    blocks = [edit(engine, random, 40) for _ in range(6)]
    # Now and then a kernel is called for the first time, and stays.
    assert min(np.diff(blocks)) < 120, "a batch that stays takes some thirty"
