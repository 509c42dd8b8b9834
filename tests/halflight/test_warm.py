"""Once warm, nothing that a session does waits for a compiler."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.halflight.commands import ROOT, invoke, run

SESSION = """
import json, sys
import numba.core.event

class Compilations(numba.core.event.Listener):
    def __init__(self):
        self.names = []
    def on_start(self, event):
        self.names.append(event.data["dispatcher"].py_func.__qualname__)
    def on_end(self, event):
        pass

compilations = Compilations()
from solver.engine.drawing import Drawing
from solver.engine.warm import warm_up
drawing = Drawing()
if sys.argv[1] == "warm first":
    warm_up(drawing)
numba.core.event.register("numba:compile", compilations)

import numpy as np
from solver.document.edits import RemoveEdit, SetMaterialEdit
from solver.document.models import MaterialDocument
from solver.document.samples import load_sample
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, NotAvailableError, RendererName
from solver.transport.settings import SolverSettings

def finish(engine):
    while engine.step(1.0):
        pass

frames = 0
for sample in ("cube_room", "office"):
    engine = Engine(load_sample(sample), SolverSettings(error_tolerance=0.05), drawing=drawing)
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
        engine.status()
        warm_light = MaterialDocument(emission=[9.0, 5.0, 1.0])
        engine.apply([
            SetMaterialEdit(op="set_material", id="lamp", material=warm_light),
            RemoveEdit(op="remove", id=next(reversed(engine.scene.objects))),
        ])
print(json.dumps({"frames": frames, "compiled": compilations.names}))
"""


def session(mode: str, **environment: str) -> list[str]:
    """Names of the kernels that sessions of a process had to compile."""
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
    names: list[str] = result["compiled"]
    return names


def test_nothing_is_compiled_after_warming_up() -> None:
    assert session("warm first") == []


def test_warm_says_when_it_is_done() -> None:
    result = invoke("warm")
    assert result.exit_code == 0
    assert result.stdout.startswith("kernels are compiled")
    assert result.stderr == ""


@pytest.mark.slow
def test_warm_on_a_fresh_machine_keeps_all_for_later_processes(tmp_path: Path) -> None:
    """With an empty cache: the command, then a session in another process that does not warm up itself."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path)}
    before = session("not warmed", NUMBA_CACHE_DIR=str(tmp_path / "other"))
    assert len(before) > 20, "the listener hears of kernels that are compiled"
    status, _, errors = run("warm", **cache)
    assert (status, errors) == (0, "")
    kept = {file.name for file in tmp_path.rglob("*.nbc")}
    assert session("not warmed", **cache) == []
    status, _, _ = run("warm", **cache)
    assert status == 0
    assert {file.name for file in tmp_path.rglob("*.nbc")} == kept, "a second time adds nothing"
