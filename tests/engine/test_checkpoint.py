"""A solution that was kept is gone on from as if nothing had happened; what is not good is not read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver.document.edits import MoveEdit
from solver.document.models import TransformDocument
from solver.engine import checkpoint_file
from solver.engine.checkpoint import Checkpoint
from solver.engine.checkpoint_file import (
    CheckpointError,
    StaleCheckpointError,
    read_checkpoint,
    write_checkpoint,
)
from solver.engine.checkpoint_fine import sample_count, without_interpolants
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.engine.status import SessionState
from solver.illumination.settings import LightSettings
from solver.types import AnyArray
from tests.engine.scenes import box

SETTINGS = LightSettings(error_tolerance=0.05)
MOVE = MoveEdit(op="move", id="crate", transform=TransformDocument(translation=[0.3, 0.5, 0.5]))


def run(engine: Engine) -> Engine:
    while engine.step(1.0):
        pass
    return engine


def settled(settings: LightSettings = SETTINGS) -> Engine:
    return run(Engine(box(), settings))


def kept(engine: Engine, file: Path) -> Checkpoint:
    """What another process reads of what this one wrote."""
    checkpoint = engine.checkpoint()
    assert checkpoint is not None
    assert write_checkpoint(checkpoint, file, lambda: True)
    return read_checkpoint(file)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "session.light"


@pytest.mark.parametrize("renderer", [RendererName.FLAT, RendererName.INTERPOLANT])
def test_it_rests_at_once_and_shows_the_same(file: Path, renderer: RendererName) -> None:
    before = settled()
    after = Engine(box(), SETTINGS, kept=kept(before, file))
    assert after.status().state is SessionState.CONVERGED
    for name in ("error_estimate", "unshot_fraction", "progress"):
        assert getattr(after.status(), name) == getattr(before.status(), name)
    request = FrameRequest(CameraChoice(width=48, height=32), renderer)
    images = []
    for engine in (before, after):
        engine.outlook(request)
        run(engine)
        assert engine.outlook(request).converged
        images.append(engine.frame(request).image)
    np.testing.assert_array_equal(images[0], images[1])


def look(engine: Engine, fov: float = 50.0) -> AnyArray:
    """The frame of a camera once all that it sees is built."""
    request = FrameRequest(CameraChoice(width=48, height=32, vertical_fov=fov), RendererName.INTERPOLANT)
    engine.outlook(request)
    run(engine)
    assert engine.outlook(request).converged
    return engine.frame(request).image


def test_interpolants_are_kept_with_it(file: Path) -> None:
    before = settled()
    first = look(before)
    checkpoint = kept(before, file)
    assert sample_count(checkpoint) > 0
    after = Engine(box(), SETTINGS, kept=checkpoint)
    np.testing.assert_array_equal(look(after), first)
    built, anew = after.status().fine, before.status().fine
    assert (built.triangles, built.interpolants) == (anew.triangles, anew.interpolants)
    assert built.point_irradiances == 0, "nothing is computed that was"
    np.testing.assert_array_equal(look(after, 60.0), look(before, 60.0))
    for engine in (after, before):
        engine.apply([MOVE])
        run(engine)
    np.testing.assert_array_equal(look(after), look(before))


def test_the_solution_alone_is_good_too(file: Path) -> None:
    before = settled()
    first = look(before)
    whole = before.checkpoint()
    assert whole is not None
    alone = without_interpolants(whole)
    assert sample_count(alone) == 0
    assert alone.nbytes < whole.nbytes
    assert write_checkpoint(alone, file, lambda: True)
    after = Engine(box(), SETTINGS, kept=read_checkpoint(file))
    np.testing.assert_array_equal(look(after), first)
    assert after.status().fine.point_irradiances > 0


def test_interpolants_by_other_settings_are_not_gone_on_from(file: Path) -> None:
    before = settled()
    look(before)
    checkpoint = kept(before, file)
    after = Engine(box(), SETTINGS, kept=checkpoint)
    after.configure(replace(SETTINGS, interpolation_error=0.3))
    anew = settled()
    anew.configure(replace(SETTINGS, interpolation_error=0.3))
    np.testing.assert_array_equal(look(after), look(anew))
    assert after.status().fine.point_irradiances > 0


def test_edits_go_on_from_it(file: Path) -> None:
    after = Engine(box(), SETTINGS, kept=kept(settled(), file))
    points, normals = np.array([[0.5, 0.2, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    probes = []
    for engine in (after, settled()):
        engine.apply([MOVE])
        run(engine)
        assert engine.status().state is SessionState.CONVERGED
        probes.append(engine.probe(points, normals).irradiance)
    np.testing.assert_array_equal(probes[0], probes[1])


def test_what_an_edit_has_led_to_is_kept_too(file: Path) -> None:
    before = settled()
    before.apply([MOVE])
    assert before.checkpoint() is None, "its light has yet to move"
    run(before)
    after = Engine(before.scene, SETTINGS, kept=kept(before, file))
    assert after.status().state is SessionState.CONVERGED
    assert after.status().statistics.links == before.status().statistics.links


def test_a_solution_that_a_limit_ended_rests_too(file: Path) -> None:
    limited = LightSettings(error_tolerance=0.001, max_elements=60)
    before = settled(limited)
    assert before.status().state is SessionState.PAUSED
    after = Engine(box(), limited, kept=kept(before, file))
    assert after.status().state is SessionState.PAUSED
    assert after.status().warnings == before.status().warnings


def test_sampled_light_is_kept_too(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solver.engine.solution.MOST_LINKED", 4)
    rough = LightSettings(error_tolerance=0.2)
    before = settled(rough)
    after = Engine(box(), rough, kept=kept(before, file))
    assert after.status().state is SessionState.CONVERGED
    request = FrameRequest(CameraChoice(width=24, height=16), RendererName.GOURAUD)
    np.testing.assert_array_equal(before.frame(request).image, after.frame(request).image)


def test_another_scene_or_other_settings_are_solved_anew(file: Path) -> None:
    checkpoint = kept(settled(), file)
    moved = Engine(box(), SETTINGS)
    moved.apply([MOVE])
    for engine in (
        Engine(moved.scene, SETTINGS, kept=checkpoint),
        Engine(box(), LightSettings(error_tolerance=0.04), kept=checkpoint),
    ):
        assert engine.status().state is SessionState.SOLVING


@pytest.mark.parametrize("place", [0, 100, 5000, -1])
def test_a_damaged_file_is_not_read(file: Path, place: int) -> None:
    kept(settled(), file)
    content = bytearray(file.read_bytes())
    content[place] ^= 1
    file.write_bytes(content)
    with pytest.raises(CheckpointError):
        read_checkpoint(file)


@pytest.mark.parametrize("length", [0, 3, 20, 60, -1])
def test_a_file_that_ends_early_is_not_read(file: Path, length: int) -> None:
    kept(settled(), file)
    file.write_bytes(file.read_bytes()[:length])
    with pytest.raises(CheckpointError):
        read_checkpoint(file)


def test_another_version_does_not_read_it(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept(settled(), file)
    monkeypatch.setattr(checkpoint_file, "source_stamp", lambda: "another")
    with pytest.raises(StaleCheckpointError):
        read_checkpoint(file)


def test_nothing_is_left_of_one_that_is_not_wanted_any_more(file: Path) -> None:
    checkpoint = settled().checkpoint()
    assert checkpoint is not None
    answers = iter([True] * 5 + [False])
    assert not write_checkpoint(checkpoint, file, lambda: next(answers))
    assert list(file.parent.iterdir()) == []
