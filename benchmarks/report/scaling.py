"""Time and memory against polygons, over scenes that are made for it, with fitted exponents."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np

from benchmarks.isolation import peak_memory, reset_peak_memory
from benchmarks.report.halls import FAMILIES
from benchmarks.report.views import HEIGHT, WIDTH
from solver.document.limits import SceneLimits
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.engine.status import SessionState
from solver.engine.warm import warm_up
from solver.illumination.settings import LightSettings

TOLERANCE: Final = 0.05
"""To which scenes are solved"""

VPL_ERROR: Final = 0.1
"""Estimate at which a frame by virtual lights is taken"""

_STEP: Final = 0.05
_LEAST: Final = 3
"""Points without which no exponent is told"""

_ANY: Final = SceneLimits(max_polygons=2**31, max_vertices=2**31)


@dataclass(frozen=True)
class Size:
    """One scene of a family. Seconds of wall time, from the scene in memory on; None where time was up."""

    family: str
    polygons: int
    patches: int
    is_linked: bool
    """Whether it was solved over links; otherwise its light was sampled"""
    first_frame: float
    """Until there is a frame of 640x480, by `gouraud`"""
    solved: float | None
    """Until the solution is within `TOLERANCE`, by its own estimate"""
    estimate: float
    """Of the solution at the end"""
    elements: int
    links: int
    virtual: float | None
    """Until a frame by virtual lights is within `VPL_ERROR`, by its own estimate; in another session"""
    memory: float
    """MB at most, without what the process has before the scene"""

    @classmethod
    def from_record(cls, record: dict[str, Any]) -> Self:
        """Of what `asdict` made."""
        return cls(**record)


@dataclass(frozen=True)
class Exponent:
    """Of a power law through points, by least squares over their logarithms."""

    value: float
    least: float
    most: float
    """Polygons from and to which there were points"""


def measure_size(family: str, polygons: int, limit: float) -> Size:
    """Solve a scene of a family, and light a frame by virtual lights, each for at most `limit` seconds."""
    drawing = Drawing()
    warm_up(drawing)
    scene = FAMILIES[family].of(polygons)
    reset_peak_memory()
    before = peak_memory()
    camera = CameraChoice(width=WIDTH, height=HEIGHT)
    start = time.perf_counter()
    engine = Engine(scene, LightSettings(error_tolerance=TOLERANCE), _ANY, drawing)
    engine.frame(FrameRequest(camera, RendererName.GOURAUD))
    first = time.perf_counter() - start
    solved = _worked(engine, start, limit, lambda: engine.status().state is SessionState.SOLVING)
    status = engine.status()
    is_solved = status.state is SessionState.CONVERGED
    found = status.statistics
    is_linked = not engine._solution.is_sampled
    patches = engine._world.surfaces.patch_count

    request = FrameRequest(camera, RendererName.VPL, max_error=VPL_ERROR)
    start = time.perf_counter()
    other = Engine(scene, LightSettings(error_tolerance=1.0), _ANY, drawing)
    virtual = _worked(other, start, limit, lambda: other.outlook(request).error_estimate > VPL_ERROR)
    return Size(
        family=family,
        polygons=found.polygons,
        patches=patches,
        is_linked=is_linked,
        first_frame=first,
        solved=solved if is_solved else None,
        estimate=status.error_estimate,
        elements=found.elements,
        links=found.links,
        virtual=virtual,
        memory=peak_memory() - before,
    )


def _worked(engine: Engine, start: float, limit: float, goes_on: Callable[[], bool]) -> float | None:
    """Seconds since `start` at which it does not go on any more, None where a limit comes first."""
    while goes_on():
        if time.perf_counter() - start > limit:
            return None
        engine.step(_STEP)
    return time.perf_counter() - start


def exponent(polygons: Sequence[int], values: Sequence[float | None]) -> Exponent | None:
    """Of the values that there are, None of too few."""
    known = [(n, v) for n, v in zip(polygons, values, strict=True) if v is not None and v > 0.0]
    if len(known) < _LEAST:
        return None
    across, up = np.log(np.array(known)).T
    return Exponent(float(np.polyfit(across, up, 1)[0]), known[0][0], known[-1][0])
