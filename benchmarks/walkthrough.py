"""A walk through the office by virtual lights: frames a second of a camera that moves, each in a given time.

Lights and what they see are kept from frame to frame, and each frame gets as many blocks of them as fit: it
is worked on for as long as another step, and the picture after it, will be there in time, judging by how long
they took last. All frames are of full resolution, and none takes anything over from the one before it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.frames import HEIGHT, WIDTH
from benchmarks.instant import frame_of
from benchmarks.plan import Job, Options, Section
from benchmarks.tables import Row, Table, Target
from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, RendererName
from solver.geometry.scene import Camera
from solver.types import LUMINANCE_WEIGHTS, FloatArray

SCENE: Final = "office"
RATE: Final = 10.0
"""Target: frames a second of those that are given a tenth of a second"""

BUDGETS: Final = (0.0, 0.1, 0.3)
"""Seconds that a frame is given; one block of lights it has in any case"""

_JUDGED: Final = 0.1
"""The one of them that the target is for"""

_STEP: Final = 0.02
"""Metres between two frames"""

_MASTER: Final = 1024
"""Paths of the frame that the last one of the walk is told against"""


@dataclass(frozen=True)
class WalkthroughFigures:
    """Of one time to a frame."""

    budget: float
    frames: int
    rate: float
    """Frames a second, read back as radiance"""
    longest: float
    """Seconds for a frame, once all lights of the first block are known"""
    paths: float
    """Of a frame, in the mean"""
    points: float
    """Milliseconds until a new camera's points are found"""
    error: float
    """Relative RMS of the last frame's irradiance, against one of many paths"""


def measure_walkthrough(budget: float, count: int) -> WalkthroughFigures:
    """`count` frames of `budget` seconds each, and two before them that are not counted."""
    scene = load_sample(SCENE)
    engine = Engine(scene, drawing=Drawing())
    camera = CameraChoice(width=WIDTH, height=HEIGHT).resolve(scene)
    seconds, found, paths = [], [], []
    step = picture = 0.0
    for number in range(-2, count):
        request = _request(camera, number)
        start = now = time.perf_counter()
        frame = frame_of(engine, request)
        found.append(time.perf_counter() - start)
        longest = 0.0
        while not frame.is_drawable or now - start + step + picture < budget:
            before = time.perf_counter()
            frame.step()
            now = time.perf_counter()
            longest = max(longest, now - before)
        frame.radiance()
        step, picture = longest, time.perf_counter() - now
        seconds.append(time.perf_counter() - start)
        paths.append(frame.paths)
    last = frame.irradiance() @ LUMINANCE_WEIGHTS
    while frame.paths < _MASTER:
        frame.step()
    return WalkthroughFigures(
        budget=budget,
        frames=count,
        rate=count / sum(seconds[2:]),
        longest=max(seconds[2:]),
        paths=float(np.mean(paths[2:])),
        points=1e3 * float(np.mean(found[2:])),
        error=_difference(last, frame.irradiance() @ LUMINANCE_WEIGHTS),
    )


def _request(camera: Camera, number: int) -> FrameRequest:
    """The view after some steps towards the camera's target."""
    towards = camera.target - camera.eye
    x, y, z = (camera.eye + _STEP * number * towards / np.linalg.norm(towards)).tolist()
    choice = CameraChoice(eye=(x, y, z), width=WIDTH, height=HEIGHT)
    return FrameRequest(choice, RendererName.VPL)


def _difference(image: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(np.sum((image - truth) ** 2) / np.sum(truth**2)))


def section(options: Options) -> Section:
    """Each time to a frame."""
    count = 10 if options.quick else 40
    jobs = tuple(Job(f"{1e3 * budget:.0f} ms", measure_walkthrough, (budget, count)) for budget in BUDGETS)
    return Section("walkthrough", jobs if SCENE in options.scenes else (), tabulate)


def tabulate(found: list[WalkthroughFigures]) -> Table:
    """One row a time."""
    return Table(
        f"A walk through the office by virtual lights, {WIDTH}x{HEIGHT}",
        ("ms a frame", "frames / s", "longest ms", "paths", "ms of points", "error"),
        tuple(
            Row(
                (
                    f"{1e3 * figures.budget:.0f}" if figures.budget > 0.0 else "one block",
                    f"{figures.rate:.1f}",
                    f"{1e3 * figures.longest:.0f}",
                    f"{figures.paths:.0f}",
                    f"{figures.points:.0f}",
                    f"{100.0 * figures.error:.1f} %",
                ),
                (Target("rate", figures.rate, RATE, at_most=False),) if figures.budget == _JUDGED else (),
            )
            for figures in found
        ),
        "The camera moves with every frame, and nothing of the picture before it is used. Error: of the last "
        f"one's irradiance, against the same view by {_MASTER:,} paths.",
    )
