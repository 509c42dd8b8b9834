"""Fine light: what interpolants take to build over a whole scene, and until a camera has them.

Errors are those of frames against path-traced references at 16 samples a pixel, over pixels that see one
plane of something that does not emit, less the references' noise.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, Target
from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.engine.status import SessionState
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS

VIEWS: Final = {"cornell": "main", "office": "birds_eye", "cube_room": "main"}
WIDTH: Final = 640
HEIGHT: Final = 480
BUILD: Final = 5.0
"""Target: seconds for so many of the office's interpolants as Hardt had"""
HARDT: Final = 6576
"""Triangles of [H]'s office, which took 2.5 hours"""
ONE_PERCENT: Final = 1.0
"""Target: seconds until a frame of cornell is within 1 %"""

_REFERENCE: Final = Path(__file__).parents[1] / "tests" / "data" / "reference"
_SLICE: Final = 0.02
_SAMPLES: Final = 16


@dataclass(frozen=True)
class FineFigures:
    """Of one scene and view, seconds from the scene in memory on."""

    scene: str
    view: str
    solved: float
    """Until the solution has converged"""
    first: float
    """Until there are interpolants to draw, the first of them built"""
    one_percent: float | None
    """Until a frame is within 1 % of the reference; None where it never is"""
    complete: float
    """Until all that is in view is built and checked, to the tolerance"""
    longest: float
    """Longest step of the engine after the solve"""
    error: float
    p99: float
    """99th percentile of a pixel's relative error, less two standard errors of the reference"""
    gouraud_error: float
    told: float
    """The error that the frame's header tells"""
    triangles: int
    built: int
    """Triangles built for the view"""
    points: int
    discontinuities: tuple[int, int, int, int]
    """Found, active, too weak, too many in a leaf"""
    everything: float
    """Seconds for the interpolants of all triangles, those of the view included"""
    everything_points: int

    @property
    def per_triangle(self) -> float:
        """Seconds that a triangle takes, on average over the view's and all others."""
        return (self.complete - self.solved + self.everything) / self.triangles


def measure_fine(name: str) -> FineFigures:
    """Build what a view of 640x480 needs, then the rest."""
    camera = VIEWS[name]
    drawing = Drawing()
    asked = FrameRequest(CameraChoice(camera, width=WIDTH, height=HEIGHT))
    # Kernels are loaded by another scene, so that no figure holds that.
    warm = Engine(load_sample("cube_room"), LightSettings(error_tolerance=0.1), drawing=drawing)
    _run(warm, asked if name == "cube_room" else FrameRequest(CameraChoice(width=64, height=64)))
    reference = _Reference.of(name, camera)
    scene = load_sample(name)

    engine, clock = Engine(scene, drawing=drawing), _Clock()
    solved = first = one_percent = None
    longest = 0.0
    while engine.outlook(asked).improving:
        seconds = clock.measure(lambda: engine.step(_SLICE))
        if engine.status().state is SessionState.SOLVING:
            continue
        if solved is None:
            solved = clock.seconds
            continue
        longest = max(longest, seconds)
        if engine.status().fine.interpolants == 0:
            continue
        first = first or clock.seconds
        if one_percent is None and reference.differences(engine)[0] <= 0.01:
            one_percent = clock.seconds
    complete = clock.seconds
    status = engine.status()
    error, p99 = reference.differences(engine)
    built, points = status.fine.interpolants, status.fine.point_irradiances
    everything = clock.measure(lambda: _build_all(engine))
    after = engine.status().fine
    return FineFigures(
        scene=name,
        view=camera,
        solved=solved or complete,
        first=first or complete,
        one_percent=one_percent,
        complete=complete,
        longest=longest,
        error=error,
        p99=p99,
        gouraud_error=reference.differences(engine, RendererName.GOURAUD)[0],
        told=engine.outlook(asked).error_estimate,
        triangles=after.triangles,
        built=built,
        points=points,
        discontinuities=(
            after.discontinuities,
            after.discontinuities_active,
            after.discontinuities_weak,
            after.discontinuities_crowded,
        ),
        everything=everything,
        everything_points=after.point_irradiances - points,
    )


class _Clock:
    """Adds up what is measured, and nothing else."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def measure(self, work: Callable[[], object]) -> float:
        """Seconds that a call of `work` takes."""
        start = time.perf_counter()
        work()
        spent = time.perf_counter() - start
        self.seconds += spent
        return spent


@dataclass(frozen=True, eq=False)
class _Reference:
    request: FrameRequest
    truth: np.ndarray[tuple[int, int], np.dtype[np.float32]]
    noise: np.ndarray[tuple[int, int], np.dtype[np.float32]]
    mask: np.ndarray[tuple[int, int], np.dtype[np.bool_]]

    @staticmethod
    def of(name: str, camera: str) -> _Reference:
        with np.load(_REFERENCE / f"{name}.{camera}.luminance.npz") as file:
            truth, noise, mask = file["luminance"], file["standard_error"], file["mask"]
        height, width = truth.shape
        request = FrameRequest(CameraChoice(camera, width=width, height=height), samples=_SAMPLES)
        return _Reference(request, truth, noise, mask)

    def differences(
        self, engine: Engine, renderer: RendererName = RendererName.INTERPOLANT
    ) -> tuple[float, float]:
        """Relative RMS error of a frame as it is now, and its pixels' 99th percentile."""
        image = engine.frame(replace(self.request, renderer=renderer)).image
        truth, noise = self.truth[self.mask].astype(np.float64), self.noise[self.mask]
        off = (image @ LUMINANCE_WEIGHTS)[self.mask] - truth
        squared = max(0.0, float(np.sum(off**2 - noise**2)) / float(np.sum(truth**2)))
        beyond = np.maximum(np.abs(off) - 2.0 * noise, 0.0) / truth
        return float(np.sqrt(squared)), float(np.quantile(beyond, 0.99))


def _run(engine: Engine, request: FrameRequest) -> None:
    while engine.outlook(request).improving:
        engine.step(_SLICE)
    engine.frame(request)


def _build_all(engine: Engine) -> None:
    engine.build_everything()
    while engine.step(_SLICE):
        pass


def section(options: Options) -> Section:
    """The small scenes."""
    names = [name for name in options.scenes if name in VIEWS]
    return Section("fine", tuple(Job(name, measure_fine, (name,)) for name in names), tabulate)


def tabulate(found: list[FineFigures]) -> Table:
    """A row for each figure of each scene."""
    return Table(
        f"Interpolants for a view of {WIDTH}x{HEIGHT}, and of whole scenes",
        ("scene", "what", "figure", "seconds"),
        tuple(row for figures in found for row in _rows(figures)),
        "Seconds from the scene in memory on; the last row of a scene: for all its triangles, from those of "
        "the view on. Errors against the reference frames, without their noise.",
        names=2,
    )


def _rows(f: FineFigures) -> list[Row]:
    seen, active, weak, crowded = f.discontinuities
    ways: list[tuple[str, str, str, tuple[Target, ...]]] = [
        ("solution converged", "", f"{f.solved:.2f}", ()),
        ("first interpolants", "", f"{f.first:.2f}", ()),
        (
            "frame within 1 %",
            "",
            "never" if f.one_percent is None else f"{f.one_percent:.2f}",
            (Target("to 1 %", f.one_percent or np.inf, ONE_PERCENT, "s"),) if f.scene == "cornell" else (),
        ),
        (
            f"view complete, {f.built:,} of {f.triangles:,} triangles",
            f"{f.points:,} points",
            f"{f.complete:.2f}",
            (),
        ),
        (
            "its error; 99th percentile",
            f"{100 * f.error:.2f} %; {100 * f.p99:.1f} %",
            "",
            (Target("error", 100 * f.error, 1.0, "%"), Target("p99", 100 * f.p99, 5.0, "%")),
        ),
        ("error told", f"{100 * f.told:.2f} %", "", ()),
        (
            "gouraud's error, of interpolants'",
            f"{100 * f.gouraud_error:.2f} %, {f.gouraud_error / max(f.error, 1e-9):.1f} times",
            "",
            (),
        ),
        (
            "discontinuities found; meshed; weak; crowded",
            f"{seen:,}; {active:,}; {weak:,}; {crowded:,}",
            "",
            (),
        ),
        ("longest step after the solve", f"{1e3 * f.longest:.0f} ms", "", ()),
        (
            f"all {f.triangles:,} triangles",
            f"{f.everything_points / max(f.everything, 1e-9):,.0f} points / s",
            f"{f.everything:.2f}",
            (),
        ),
        (
            f"for {HARDT:,} triangles of them",
            "",
            f"{f.per_triangle * HARDT:.2f}",
            (Target("as many as in 1996", f.per_triangle * HARDT, BUILD, "s"),)
            if f.scene == "office"
            else (),
        ),
    ]
    return [Row((f.scene, what, figure, seconds), targets) for what, figure, seconds, targets in ways]
