"""Frames by virtual lights: error against time, for as many paths as [K] takes and more.

Errors are those of frames against path-traced references, over pixels that see one plane of something that
does not emit, less the references' noise.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, Target, percent
from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.instant.frame import InstantFrame
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.engine.views import InstantView
from solver.types import LUMINANCE_WEIGHTS

VIEWS: Final = (("cornell", "main"), ("cube_room", "main"), ("office", "birds_eye"))
PATHS: Final = (32, 128, 512, 2048)
"""[K figs. 10 to 12] have 128"""
ERROR: Final = 0.015
"""Target: relative RMS error with most paths"""

_SAMPLES: Final = 4
"""Of a pixel"""

_REFERENCE: Final = Path(__file__).parents[1] / "tests" / "data" / "reference"


@dataclass(frozen=True)
class Shot:
    """A frame of so many paths."""

    paths: int
    lights: int
    """Made so far"""
    seconds: float
    """From the scene in memory on"""
    error: float
    estimate: float
    p99: float
    """99th percentile of a pixel's relative error, less two standard errors of the reference"""


@dataclass(frozen=True)
class InstantFigures:
    """Of one scene and view."""

    scene: str
    view: str
    width: int
    height: int
    first: float
    """Seconds until there is a picture"""
    shots: tuple[Shot, ...]
    slope: float
    """Of the logarithm of the error by that of the number of paths"""


def frame_of(engine: Engine, request: FrameRequest) -> InstantFrame:
    """The frame by virtual lights that answers `request`."""
    view = engine._view(request)
    if not isinstance(view, InstantView):
        raise ValueError(f"a frame by virtual lights is wanted, not one of {request.renderer}")
    return view.asked.frame


def measure_instant(name: str, camera: str, most: int) -> InstantFigures:
    """Frames of up to `most` paths, by default settings."""
    with np.load(_REFERENCE / f"{name}.{camera}.luminance.npz") as file:
        truth, noise, mask = file["luminance"], file["standard_error"], file["mask"]
    height, width = truth.shape
    truth, noise = truth[mask].astype(np.float64), noise[mask].astype(np.float64)
    request = FrameRequest(CameraChoice(camera, width=width, height=height), RendererName.VPL)
    request = replace(request, samples=_SAMPLES)
    drawing = Drawing()
    # Kernels are loaded by another engine, so that no figure holds that.
    warm = frame_of(Engine(load_sample(name), drawing=drawing), request)
    while not warm.is_new:
        warm.step()

    scene = load_sample(name)
    start = time.perf_counter()
    frame = frame_of(Engine(scene, drawing=drawing), request)
    spent, first, shots = time.perf_counter() - start, 0.0, []
    for paths in [paths for paths in PATHS if paths <= most]:
        while frame.paths < paths:
            start = time.perf_counter()
            frame.step()
            spent += time.perf_counter() - start
            first = first or (spent if frame.is_drawable else 0.0)
        off = (frame.radiance() @ LUMINANCE_WEIGHTS)[mask] - truth
        squared = max(0.0, float(np.sum(off**2 - noise**2) / np.sum(truth**2)))
        beyond = np.maximum(np.abs(off) - 2.0 * noise, 0.0) / truth
        shots.append(
            Shot(
                paths,
                frame._blocks.light_count,
                spent,
                float(np.sqrt(squared)),
                frame.error_estimate,
                float(np.quantile(beyond, 0.99)),
            )
        )
    counts, errors = [shot.paths for shot in shots], [shot.error for shot in shots]
    slope = float(np.polyfit(np.log(counts), np.log(errors), 1)[0])
    return InstantFigures(name, camera, width, height, first, tuple(shots), slope)


def section(options: Options) -> Section:
    """The scenes that have references; up to 512 paths, if it is to be quick."""
    most = PATHS[-2] if options.quick else PATHS[-1]
    jobs = tuple(
        Job(f"{name}, {camera}", measure_instant, (name, camera, most))
        for name, camera in VIEWS
        if name in options.scenes
    )
    return Section("instant", jobs, tabulate)


def tabulate(found: list[InstantFigures]) -> Table:
    """One row a view and number of paths."""
    return Table(
        "Frames by virtual lights",
        ("scene", "view", "paths", "lights", "seconds", "error", "estimate", "p99", "slope"),
        tuple(_row(figures, shot) for figures in found for shot in figures.shots),
        f"Frames of {_SAMPLES} samples a pixel, of the references' sizes; no solve is waited for. Slope: of "
        "the error's logarithm, -1/2 for random walks. Below 64 paths no error is estimated.",
        names=2,
    )


def _row(figures: InstantFigures, shot: Shot) -> Row:
    is_last = shot is figures.shots[-1]
    return Row(
        (
            figures.scene,
            f"{figures.view} {figures.width}x{figures.height}",
            f"{shot.paths:,}",
            f"{shot.lights:,}",
            f"{shot.seconds:.2f}",
            percent(shot.error),
            percent(shot.estimate) if shot.estimate < 1.0 else "-",
            percent(shot.p99, 1),
            f"{figures.slope:.2f}" if is_last else "",
        ),
        (Target("error", 100.0 * shot.error, 100.0 * ERROR, "%"),) if shot.paths == PATHS[-1] else (),
    )
