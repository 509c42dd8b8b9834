"""What a scene costs without each of the savings ("model only what a scene needs")."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from benchmarks.isolation import peak_memory
from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, percent
from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.engine.status import Spared
from solver.engine.warm import warm_up
from solver.illumination.settings import LightSettings
from solver.transport.settings import Saving
from solver.types import LUMINANCE_WEIGHTS

_REQUEST: Final = FrameRequest(
    CameraChoice(width=320, height=240), RendererName.INTERPOLANT, LayerName.IRRADIANCE
)
_SCENES: Final = ("cornell", "office")
_QUICK_TOLERANCE: Final = 0.05


@dataclass(frozen=True)
class Cost:
    """A scene with all savings but one."""

    in_full: str | None
    """None: all are made"""
    seconds: float
    """Until the frame is complete, the fastest of some"""
    rays: int
    memory: float
    """MB, of the process"""
    difference: float
    """Relative RMS difference of the frame's irradiance from the one with all savings"""


@dataclass(frozen=True)
class SceneCosts:
    """A scene with and without each saving."""

    scene: str
    tolerance: float
    told: tuple[Spared, ...]
    """By the session with all savings, when its frame is complete"""
    costs: tuple[Cost, ...]


def measure_savings(scene: str, tolerance: float, times: int) -> SceneCosts:
    """Solve and draw a scene with all savings, and without each."""
    drawing = Drawing()
    warm_up(drawing)
    settings = LightSettings(error_tolerance=tolerance)
    costs: list[Cost] = []
    told: tuple[Spared, ...] = ()
    base = np.empty(0)
    for saving in (None, *Saving):
        chosen = settings if saving is None else replace(settings, in_full=(saving,))
        seconds = []
        for _ in range(times):
            start = time.perf_counter()
            engine = Engine(load_sample(scene), chosen, drawing=drawing)
            while engine.outlook(_REQUEST).improving:
                engine.step(0.05)
            image = np.asarray(engine.frame(_REQUEST).image, dtype=np.float64) @ LUMINANCE_WEIGHTS
            while engine.step(0.05):  # what no camera sees, where that is not spared
                pass
            seconds.append(time.perf_counter() - start)
        if saving is None:
            base, told = image, engine.status().savings
        difference = float(np.sqrt(np.mean((image - base) ** 2) / np.mean(base**2)))
        rays = engine.status().statistics.rays
        costs.append(Cost(saving, min(seconds), rays, peak_memory(), difference))
    return SceneCosts(scene, tolerance, told, tuple(costs))


def section(options: Options) -> Section:
    """Scenes with colours and without."""
    tolerance = _QUICK_TOLERANCE if options.quick else LightSettings().error_tolerance
    scenes = [name for name in _SCENES if name in options.scenes]
    times = 1 if options.quick else 3
    jobs = tuple(Job(name, measure_savings, (name, tolerance, times)) for name in scenes)
    return Section("savings", jobs, tabulate)


def tabulate(found: list[SceneCosts]) -> Table:
    """One row a scene and saving."""
    return Table(
        "What each saving is worth",
        (
            "scene", "saving", "spared", "of", "error told", "seconds with", "without", "rays with",
            "without", "difference of the frame",
        ),
        tuple(Row(_cells(scene, cost)) for scene in found for cost in scene.costs[1:]),
        "Until a frame of 320x240 by interpolants is complete, and all that is asked for besides. Without "
        "one saving at a time, by `settings.in_full`; the difference is that of the frame's irradiance.",
        names=2,
    )  # fmt: skip


def _cells(scene: SceneCosts, cost: Cost) -> tuple[str, ...]:
    spared = next(one for one in scene.told if one.saving == cost.in_full)
    base = scene.costs[0]
    return (
        f"{scene.scene}, {percent(scene.tolerance, 0)}",
        str(cost.in_full).replace("_", " "),
        f"{spared.spared:,}",
        f"{spared.of:,}",
        percent(spared.error_estimate, 2),
        f"{base.seconds:.2f}",
        f"{cost.seconds:.2f}",
        f"{base.rays:,}",
        f"{cost.rays:,}",
        percent(cost.difference, 3),
    )
