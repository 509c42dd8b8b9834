"""Once warm, nothing that a session does waits for a compiler."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from solver.engine.kept_kernels import load_kept_kernels
from tests.halflight.commands import ROOT, invoke, run

UNUSED_BY_SESSIONS = {
    "solver.illumination.particles.path_numbers._fill_random",
    "solver.illumination.particles.path_numbers._jitter",
    "solver.illumination.particles.radical_inverse.radical_inverse",
    "solver.rendering.interpolant_pass._join_corners",
}
"""Kept only where something else has called them: what there is to compare with, and linear interpolants."""

SESSION = """
import gc, json, sys
from numba.core.dispatcher import Dispatcher

def kernels():
    # Compiled or loaded: either way somebody has waited for it.
    return {
        f"{kernel.py_func.__qualname__}{signature}"
        for kernel in gc.get_objects()
        if isinstance(kernel, Dispatcher) and kernel.py_func.__module__.startswith("solver.")
        for signature in kernel.signatures
    }

def compiled():
    # Of those, what was not found on disk.
    return {
        f"{kernel.py_func.__qualname__}{signature}"
        for kernel in gc.get_objects()
        if isinstance(kernel, Dispatcher) and kernel.py_func.__module__.startswith("solver.")
        for signature in kernel.stats.cache_misses
    }

from solver.engine.drawing import Drawing
from solver.engine.warm import warm_up
drawing = Drawing()
if sys.argv[1] == "warm first":
    warm_up(drawing)
warm = kernels()

import numpy as np
from solver.document.edits import RemoveEdit, SetMaterialEdit
from solver.document.models import MaterialDocument
from solver.document.samples import load_sample
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, NotAvailableError, RendererName
from solver.illumination.settings import LightSettings

def finish(engine):
    while engine.step(1.0):
        pass

frames = 0
for sample in ("cube_room", "office"):
    engine = Engine(load_sample(sample), LightSettings(error_tolerance=0.05), drawing=drawing)
    for _ in range(2):
        finish(engine)
        for renderer in RendererName:
            for layer in LayerName:
                request = FrameRequest(CameraChoice(width=16, height=12), renderer, layer, 4)
                try:
                    while not engine.outlook(request).drawable:
                        engine.step(0.01)
                    engine.frame(request)
                    frames += 1
                except NotAvailableError:
                    pass
        engine.probe(np.array([[1.0, 1.0, 0.5]]), np.array([[0.0, 0.0, 1.0]]))
        engine.pick(CameraChoice(width=16, height=12), 8, 6)
        engine.status()
        warm_light = MaterialDocument(
            reflectance=[0.2] * 3, emission=[9.0, 5.0, 1.0], emission_exponent=3.0,
            specular=[0.5] * 3, exponent=9.0,
        )
        engine.apply([
            SetMaterialEdit(op="set_material", id="lamp", material=warm_light),
            RemoveEdit(op="remove", id=next(reversed(engine.scene.objects))),
        ])
import service.hosting.worker
from solver.engine.kept_kernels import entered_kernels
foreseen = set(map(id, entered_kernels()))
unforeseen = [
    kernel.__name__ for kernel in gc.get_objects()
    if isinstance(kernel, Dispatcher) and kernel.signatures and id(kernel) not in foreseen
]
print(json.dumps({"frames": frames, "warm": len(warm), "added": sorted(kernels() - warm),
                  "compiled": sorted(compiled()), "unforeseen": unforeseen}))
"""


class Session(NamedTuple):
    """The kernels that sessions of a process waited for."""

    warm: int
    """How many there were before"""
    added: list[str]
    """Those that `warm_up` had not called"""
    compiled: list[str]
    """Those that were not on disk, before or in the session"""
    unforeseen: list[str]
    """Those that are not loaded where all are that are kept"""


def session(mode: str, **environment: str) -> Session:
    """Solve, edit, draw, trace and probe in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", SESSION, mode],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.splitlines()[-1])
    assert result["frames"] >= 2 * 2 * 17, "flat and gouraud in every layer, and paths"
    return Session(result["warm"], result["added"], result["compiled"], result["unforeseen"])


def test_warming_up_calls_every_kernel_that_a_session_calls() -> None:
    told = session("warm first")
    assert told.warm > 30
    assert told.added == []
    assert told.unforeseen == []


def test_warm_says_when_it_is_done_and_all_can_be_loaded_at_one_go() -> None:
    result = invoke("warm")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.startswith("kernels are compiled")
    assert set(load_kept_kernels()) <= UNUSED_BY_SESSIONS


@pytest.mark.slow
def test_warm_on_a_fresh_machine_keeps_all_for_later_processes(tmp_path: Path) -> None:
    """With an empty cache: the command, then a session in another process that does not warm up itself."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path)}
    before = session("not warmed", NUMBA_CACHE_DIR=str(tmp_path / "other"))
    assert len(before.compiled) > 20, "without the command, sessions compile"
    status, _, errors = run("warm", **cache)
    assert (status, errors) == (0, "")
    kept = {file.name for file in tmp_path.rglob("*.nbc")}
    assert session("not warmed", **cache).compiled == []
    status, _, _ = run("warm", **cache)
    assert status == 0
    assert {file.name for file in tmp_path.rglob("*.nbc")} == kept, "a second time adds nothing"
