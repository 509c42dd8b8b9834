"""The whole chain on a scene: solve it, probe it, draw it; and what is right of any scene."""

from __future__ import annotations

import math
import time
from typing import Final

import numpy as np

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import FrameRequest, RendererName
from solver.engine.status import SessionState
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from solver.pathtracing import PathTracer
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Points

TOLERANCE: Final = 0.05
SETTINGS: Final = LightSettings(error_tolerance=TOLERANCE, max_paths=32, vpl_resolution=32)

LONGEST: Final = 120.0
"""Seconds of the processor within which anything here is done, unless it says so."""

MOST_BYTES: Final = 1 << 28
"""That a solution of a small scene may hold"""

DARK: Final = 1e-12
"""W/m2 that are nothing, beside lamps of 1 W/m2 and more that have shone"""

CLOSED: Final = 5e-3
"""Share by which what a closed scene absorbs may differ from what it emits."""

RENDERERS: Final = (RendererName.FLAT, RendererName.INTERPOLANT, RendererName.VPL)

_PROBED: Final = 100
"""Leaves at whose middles and corners the light is probed, at most."""

_PATHS: Final = 1 << 13


def solve(
    scene: Scene, drawing: Drawing, settings: LightSettings = SETTINGS, longest: float = LONGEST
) -> Engine:
    """The engine of a scene, when it has nothing to do."""
    return settle(Engine(scene, settings, drawing=drawing), longest)


def settle(engine: Engine, longest: float = LONGEST) -> Engine:
    """The engine, when it has nothing to do, which is to be in time."""
    start = time.process_time()
    while engine.step(0.1):
        assert time.process_time() - start < longest, "time is bounded"
    return engine


def complete(engine: Engine, renderer: RendererName) -> FloatArray:
    """The frame (h, w, 3) of the scene's camera, once it cannot get better."""
    request = FrameRequest(renderer=renderer)
    start = time.process_time()
    while engine.outlook(request).improving:
        engine.step(0.1)
        assert time.process_time() - start < LONGEST, "time is bounded"
    return np.asarray(engine.frame(request).image, dtype=np.float64)


def brightest(engine: Engine) -> float:
    """W/m2 that no radiosity of the scene exceeds: as if all were as its lamps and its lightest walls."""
    surfaces = engine._world.surfaces
    most = surfaces.emission.max(initial=0.0) / (1.0 - surfaces.reflectance.max(initial=0.0))
    return float(most) + DARK


def power(engine: Engine) -> tuple[float, float]:
    """W of luminance that are emitted and absorbed."""
    surfaces, field = engine._world.surfaces, engine._solution.field()
    kept = (1.0 - surfaces.reflectance[field.patch]) * field.irradiance
    emitted = surfaces.area @ (surfaces.emission @ LUMINANCE_WEIGHTS)
    return float(emitted), float(field.area @ (kept @ LUMINANCE_WEIGHTS))


def assert_sound(engine: Engine, frames: bool = True) -> None:
    """Converged in bounded memory, finite, neither negative nor brighter than can be, and energy kept."""
    status = engine.status()
    assert status.state is SessionState.CONVERGED, status.warnings
    assert status.error_estimate <= engine.settings.error_tolerance
    assert status.statistics.memory_bytes < MOST_BYTES
    most, field = brightest(engine), engine._solution.field()
    assert_within(field.irradiance, most)
    assert_within(field.radiosity, most)
    emitted, absorbed = power(engine)
    nothing = DARK * float(engine._world.surfaces.area.sum())
    if status.statistics.closed:
        assert abs(absorbed - emitted) <= CLOSED * emitted + nothing
    else:
        assert absorbed <= (1.0 + engine.settings.error_tolerance) * emitted + nothing
    every = max(1, len(field.area) // _PROBED)
    corners, patch = field.corners[::every], field.patch[::every]
    normals = engine._world.surfaces.normal[patch]
    for positions in (corners[:, :3].mean(axis=1), corners[:, 0], 0.5 * (corners[:, 0] + corners[:, 1])):
        assert_within(engine.probe(positions, normals).irradiance, most)
    for renderer in RENDERERS if frames else ():
        image = complete(engine, renderer)
        # Few virtual lights are noisy; the others show the solution.
        assert_within(image, math.inf if renderer is RendererName.VPL else most / math.pi)
    assert not any("cannot be built" in warning for warning in engine.status().warnings)


def assert_within(light: FloatArray, most: float) -> None:
    """Finite, not negative, and at most `most` within the tolerance."""
    assert np.isfinite(light).all()
    assert light.min(initial=0.0) >= 0.0
    assert light.max(initial=0.0) <= (1.0 + TOLERANCE) * most


def irradiance(engine: Engine, positions: Points, normals: FloatArray) -> FloatArray:
    """(n,) luminance irradiance at points (n, 3) with normals (n, 3) or (3,), as probes tell it."""
    normals = np.broadcast_to(np.asarray(normals, dtype=float), np.shape(positions))
    found = engine.probe(np.asarray(positions, dtype=float), normals).irradiance
    return np.asarray(found @ LUMINANCE_WEIGHTS)


def assert_traced(engine: Engine, positions: Points, normals: FloatArray, within: float = TOLERANCE) -> None:
    """Probes agree with traced paths at points (n, 3) with normals (n, 3) or (3,), noise taken off.

    RMS, relative to the light at the points or on all surfaces, whichever is more.
    """
    positions = np.asarray(positions, dtype=float)
    normals = np.broadcast_to(np.asarray(normals, dtype=float), positions.shape)
    found = irradiance(engine, positions, normals)
    world = engine._world
    mean, error = PathTracer(world.surfaces, world.rays, 7).irradiance(positions, normals, _PATHS)
    expected, noise = mean @ LUMINANCE_WEIGHTS, error @ LUMINANCE_WEIGHTS
    off = np.sqrt(np.mean((found - expected) ** 2))
    field = engine._solution.field()
    everywhere = field.area @ (field.irradiance @ LUMINANCE_WEIGHTS) ** 2 / field.area.sum()
    scale = math.sqrt(max(float(everywhere), float(np.mean(expected**2))))
    # What is seen of so few points' noise varies itself.
    assert off <= within * scale + 2.0 * np.sqrt(np.mean(noise**2))


def difference(one: FloatArray, other: FloatArray) -> float:
    """Relative RMS difference."""
    scale = float(np.mean(other**2))
    off = float(np.mean((one - other) ** 2))
    return math.sqrt(off / scale) if scale > 0.0 else float(off > 0.0)
