"""A worker keeps its session's light: once it rests, and again with the interpolants that were wanted."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from service.hosting import light_keeping
from service.hosting.light_keeping import LightKeeper, LightPlace
from solver.engine.checkpoint_file import read_checkpoint
from solver.engine.checkpoint_fine import sample_count
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.illumination.settings import LightSettings
from tests.engine.acting import settle
from tests.engine.scenes import box
from tests.service.processes import eventually

SETTINGS = LightSettings(error_tolerance=0.05)
LOOK = FrameRequest(CameraChoice(width=48, height=32), RendererName.INTERPOLANT)


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for calm in ("_CALM", "_LONG_CALM"):
        monkeypatch.setattr(light_keeping, calm, 0.0)


@pytest.fixture
def place(tmp_path: Path) -> LightPlace:
    return LightPlace(tmp_path / "light" / "session.light", 2**26)


def samples_in(place: LightPlace) -> int:
    return sample_count(read_checkpoint(place.file)) if place.file.exists() else -1


def look(engine: Engine) -> None:
    engine.outlook(LOOK)
    settle(engine)


def rest(keeper: LightKeeper, engine: Engine) -> None:
    """What a worker does when its work has ended."""
    keeper.note(engine.status().state)
    keeper.has_built()
    keeper.keep(engine)


def test_it_is_written_again_with_what_was_built(place: LightPlace) -> None:
    engine, keeper = Engine(box(), SETTINGS), LightKeeper(place)
    settle(engine)
    rest(keeper, engine)
    assert eventually(lambda: samples_in(place) == 0)
    look(engine)
    rest(keeper, engine)
    assert eventually(lambda: samples_in(place) > 0)
    written = place.file.stat().st_mtime_ns
    rest(keeper, engine)
    time.sleep(0.1)
    assert place.file.stat().st_mtime_ns == written, "nothing is new"

    woken = LightKeeper(place)
    found = woken.read()
    again = Engine(box(), SETTINGS, kept=found)
    rest(woken, again)
    rest(woken, again)
    time.sleep(0.1)
    assert place.file.stat().st_mtime_ns == written, "nobody has looked yet, which loses nothing"
    look(again)
    assert again.status().fine.point_irradiances == 0
    np.testing.assert_array_equal(again.frame(LOOK).image, engine.frame(LOOK).image)


def test_what_is_too_large_with_interpolants_is_kept_without(place: LightPlace) -> None:
    engine = Engine(box(), SETTINGS)
    settle(engine)
    alone = engine.checkpoint()
    assert alone is not None
    look(engine)
    keeper = LightKeeper(LightPlace(place.file, alone.nbytes))
    rest(keeper, engine)
    assert eventually(lambda: samples_in(place) == 0)
