"""Frames a second at 640x480: each renderer, with and without a file made of them, and the path tracer.

The camera moves from frame to frame over a settled solution, as a viewer's does; and over one that changes,
in its light or in its leaves too, as they do after an edit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from benchmarks.plan import Job, Options, Section
from benchmarks.solving import solve_once
from benchmarks.tables import Row, Table, Target
from benchmarks.timing import best_of, calls_per_second
from solver.document.samples import load_sample
from solver.engine.drawing import encode
from solver.engine.requests import CameraChoice, Encoding, LayerName
from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces
from solver.pathtracing import PathTracer
from solver.rendering.device import GlDevice
from solver.rendering.encoding import PictureFormat
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.tessellation import Tessellator
from solver.transport.field import RadiosityField
from solver.transport.settings import SolverSettings
from solver.types import AnyArray

SCENES: Final = ("cornell", "office")
WIDTH: Final = 640
HEIGHT: Final = 480
LEAST_FRAMES: Final = 60.0
"""Target: gouraud frames a second, not encoded"""

_PATH_SAMPLES: Final = 4
"""Of a pixel, in one pass"""

_STEP: Final = 0.01
"""Radians by which the camera goes round its target between two frames"""

_Revision: TypeAlias = tuple[Surfaces, RadiosityField]


@dataclass(frozen=True)
class FrameFigures:
    """What is drawn a second."""

    scene: str
    triangles: int
    flat: float
    """Frames a second, read back as float32 radiance"""
    gouraud: float
    four_samples: float
    """Gouraud with 4 samples of a pixel"""
    jpeg: float
    """Gouraud, tone-mapped and encoded"""
    new_light: float
    """Gouraud, each frame of the same leaves in other light"""
    new_leaves: float
    """Gouraud, each frame after one object has moved with its leaves"""
    empty: float
    """Frames in which nothing is seen: what clearing and reading back take alone"""
    path: float
    """Path-traced frames of 1 sample a pixel"""
    path_rays: float
    """Rays a second that it traces"""


def measure_frames(name: str, seconds: float) -> FrameFigures:
    """Draw the default solution of a sample scene, each way for about `seconds`."""
    scene = load_sample(name)
    solved = solve_once(scene, SolverSettings())
    surfaces, field = solved.world.surfaces, solved.solver.field()
    mesh = Tessellator(surfaces).mesh(field)
    renderer = FrameRenderer(GlDevice())
    camera = CameraChoice(width=WIDTH, height=HEIGHT).resolve(scene)
    away = replace(camera, eye=camera.eye + 1e3 * solved.world.surfaces.size * (camera.eye - camera.target))
    away = replace(away, target=2.0 * away.eye - camera.target)

    def draw(shading: Shading, number: int, samples: int = 1) -> AnyArray:
        return renderer.draw(mesh, moved(camera, number), shading, Layer.RADIANCE, samples)

    jpeg = Encoding(PictureFormat.JPEG)
    rates = {
        "flat": calls_per_second(lambda k: draw(Shading.FLAT, k), seconds),
        "gouraud": calls_per_second(lambda k: draw(Shading.GOURAUD, k), seconds),
        "four_samples": calls_per_second(lambda k: draw(Shading.GOURAUD, k, 4), seconds),
        "jpeg": calls_per_second(
            lambda k: encode(draw(Shading.GOURAUD, k), LayerName.RADIANCE, jpeg), seconds
        ),
        "new_light": calls_per_second(
            _in_turn(renderer, camera, (surfaces, field), _relit(surfaces, field)), seconds
        ),
        "new_leaves": calls_per_second(
            _in_turn(renderer, camera, (surfaces, field), _edited(surfaces, field)), seconds
        ),
        "empty": calls_per_second(
            lambda _: renderer.draw(mesh, away, Shading.GOURAUD, Layer.RADIANCE), seconds
        ),
    }
    tracer = PathTracer(solved.world.surfaces, solved.world.rays)
    traced = [tracer.frame(camera, _PATH_SAMPLES, 1) for _ in range(3)]
    path_seconds = min(best_of(frame.run, 1) for frame in traced)
    return FrameFigures(
        scene=name,
        triangles=len(mesh.triangles),
        path=_PATH_SAMPLES / path_seconds,
        path_rays=traced[0].ray_count / path_seconds,
        **rates,
    )


def _in_turn(renderer: FrameRenderer, camera: Camera, *revisions: _Revision) -> Callable[[int], AnyArray]:
    """Draws the next revision with each call."""
    tessellator = Tessellator(revisions[0][0])

    def draw(number: int) -> AnyArray:
        nonlocal tessellator
        surfaces, field = revisions[number % len(revisions)]
        if tessellator.surfaces is not surfaces:
            tessellator = Tessellator(surfaces, tessellator)
        return renderer.draw(tessellator.mesh(field), moved(camera, number), Shading.GOURAUD, Layer.RADIANCE)

    return draw


def _relit(surfaces: Surfaces, field: RadiosityField) -> _Revision:
    """In a little more light."""
    return surfaces, replace(field, irradiance=1.01 * field.irradiance, radiosity=1.01 * field.radiosity)


def _edited(surfaces: Surfaces, field: RadiosityField) -> _Revision:
    """With the object of fewest patches moved a little, and its leaves with it."""
    is_moved = surfaces.object == np.argmin(np.bincount(surfaces.object))
    offset = _STEP * surfaces.size * is_moved[:, None, None]
    return (
        replace(surfaces, corners=surfaces.corners + offset),
        replace(field, corners=field.corners + offset[field.patch]),
    )


def moved(camera: Camera, number: int) -> Camera:
    """The camera after some steps round its target and back, about the axis that is up."""
    angle = _STEP * (number % 40 - 20)
    up = camera.up / np.linalg.norm(camera.up)
    arm = camera.eye - camera.target
    turned = np.cos(angle) * arm + np.sin(angle) * np.cross(up, arm) + (1.0 - np.cos(angle)) * (up @ arm) * up
    return replace(camera, eye=camera.target + turned)


def section(options: Options) -> Section:
    """The small scenes."""
    seconds = 0.3 if options.quick else 1.5
    names = [name for name in options.scenes if name in SCENES]
    return Section("frames", tuple(Job(name, measure_frames, (name, seconds)) for name in names), tabulate)


def tabulate(found: list[FrameFigures]) -> Table:
    """One row a scene and way of drawing."""
    return Table(
        f"Frames a second at {WIDTH}x{HEIGHT}",
        ("scene", "way", "frames / s", "ms", "of gouraud"),
        tuple(row for figures in found for row in _rows(figures)),
        "Frames are read back as float32 radiance; jpeg: tone-mapped with automatic exposure and encoded.",
        names=2,
    )


def _rows(figures: FrameFigures) -> list[Row]:
    target = Target("frames", figures.gouraud, LEAST_FRAMES, "/s", at_most=False)
    ways = (
        (f"flat, {figures.triangles:,} triangles", figures.flat, ()),
        ("gouraud", figures.gouraud, (target,)),
        ("gouraud, 4 samples", figures.four_samples, ()),
        ("gouraud as jpeg", figures.jpeg, ()),
        ("gouraud, other light", figures.new_light, ()),
        ("gouraud, one object moved", figures.new_leaves, ()),
        ("nothing in view", figures.empty, ()),
        (f"path, 1 sample, {figures.path_rays / 1e6:.1f} M rays / s", figures.path, ()),
    )
    return [
        Row(
            (figures.scene, way, f"{rate:.1f}", f"{1e3 / rate:.1f}", f"{rate / figures.gouraud:.2f}"),
            targets,
        )
        for way, rate, targets in ways
    ]
