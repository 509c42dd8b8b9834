"""Mitsuba 3's path tracer over the same views, raw and denoised: what else a reader might use.

It is an extra (`pip install .[peers]`): where it is not installed, or finds no LLVM to compile with, the
report says so. Samples of a pixel double until the picture is within 1 %, or time is up; each picture holds
all samples before it. Loading the scene is in the time, compiling is not: pictures are made by kernels that a
first one has compiled. After an edit it starts over.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Final

import numpy as np

from benchmarks.isolation import peak_memory, reset_peak_memory
from benchmarks.report.front import GOALS
from benchmarks.report.trials import Case, Ending, Shot, Trial, Trials
from benchmarks.report.truth import Truth
from benchmarks.report.views import CAMERA
from solver.document.samples import load_sample
from solver.engine.world import World
from solver.types import AnyArray, Float32Array

RAW: Final = "Mitsuba path"
DENOISED: Final = "Mitsuba path + OIDN"

_PACKAGES: Final = ("mitsuba", "pyoidn")
_VARIANT: Final = "llvm_ad_rgb"
_PASSES: Final = (1, 2, 4, 8, 16, 64)
"""Samples of a pixel that are stratified together: the most that fit are taken"""

_REHEARSED: Final = 0.4
"""Share of the limit after which no larger passes are compiled, nor made"""


def missing_peers() -> str:
    """Why there are no peers; empty where there are."""
    missing = [name for name in _PACKAGES if find_spec(name) is None]
    if missing:
        return f"not installed: {', '.join(missing)} (pip install .[peers])"
    return ""


def peer_versions() -> str:
    """Of what is installed."""
    told = []
    for name in _PACKAGES:
        try:
            told.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return ", ".join(told)


def measure_peer(scene: str, is_denoised: bool, limit: float) -> Trials:
    """Pictures of a sample scene, until one is within the least goal or `limit` seconds are over."""
    missing = missing_peers()
    if missing:
        return Trials((), missing)
    import mitsuba as mi

    try:
        mi.set_variant(_VARIANT)
    except (ImportError, RuntimeError) as refused:
        return Trials((), f"not able to compile: {' '.join(str(refused).split())}")
    from benchmarks.report.mitsuba_scene import mitsuba_scene

    loaded, truth = load_sample(scene), Truth.of(scene)
    camera = CAMERA.resolve(loaded)
    denoise = _denoiser() if is_denoised else _as_it_is
    rehearsed = mitsuba_scene(World.of(loaded), camera, is_denoised)
    # Each number of samples has kernels of its own.
    start, passes = time.perf_counter(), list[int]()
    for samples in _PASSES:
        denoise(np.array(mi.render(rehearsed, spp=samples)))
        passes.insert(0, samples)
        if time.perf_counter() - start > _REHEARSED * limit:
            break

    reset_peak_memory()
    start = time.perf_counter()
    shown = mitsuba_scene(World.of(loaded), camera, is_denoised)
    seconds, samples = time.perf_counter() - start, 0
    total = np.zeros((camera.height, camera.width, 9 if is_denoised else 3))
    shots: list[Shot] = []
    while True:
        wanted = max(1, 2 * samples)
        start = time.perf_counter()
        while samples < wanted:
            now = next(size for size in passes if size <= wanted - samples)
            total += now * np.array(mi.render(shown, spp=now, seed=samples), dtype=np.float64)
            samples += now
        image = (total / samples).astype(np.float32)
        seconds += time.perf_counter() - start
        start = time.perf_counter()
        picture = denoise(image)
        shots.append(Shot(seconds + time.perf_counter() - start, truth.error(picture)))
        is_reached = shots[-1].error <= min(GOALS)
        if is_reached or seconds > (limit if is_denoised else 0.5 * limit):
            break
    return Trials(
        (
            Trial(
                scene=scene,
                case=Case.COLD,
                renderer=DENOISED if is_denoised else RAW,
                setting=f"{samples} samples",
                shots=tuple(shots),
                ending=Ending.COMPLETE if is_reached else Ending.TIME,
                peak_memory=peak_memory(),
                note=f"{samples} samples a pixel at the end",
                is_peer=True,
            ),
        )
    )


def _as_it_is(image: Float32Array) -> AnyArray:
    return image[:, :, :3]


def _denoiser() -> Callable[[Float32Array], AnyArray]:
    """Intel's Open Image Denoise on the CPU, with albedo and normal as guides, its filter made once."""
    import pyoidn

    def denoise(image: Float32Array) -> AnyArray:
        color, albedo, normal = (np.ascontiguousarray(image[:, :, k : k + 3]) for k in (0, 3, 6))
        found: AnyArray = pyoidn.denoise(color, albedo=albedo, normal=normal, hdr=True)
        return found

    return denoise
