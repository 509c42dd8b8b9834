"""Errors told and errors true, of one scene at several stages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np

from benchmarks.calibration.rooms import random_room
from benchmarks.calibration.shown import Shown, true_luminance
from benchmarks.witness import measured_error
from solver.document.edits import MoveEdit
from solver.document.models import TransformDocument
from solver.document.samples import load_sample
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings
from solver.transport.solve import RadiositySolver
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Points

TOLERANCES: Final = (0.1, 0.04, 0.02)
"""One after the other, in one session"""

_CAMERA: Final = CameraChoice(width=64, height=48)
_SLICE: Final = 0.05
_LEAST_TRUE: Final = 1e-3
"""True errors below this are as hard to tell from it as from nothing."""

_SHOWN: Final = (RendererName.FLAT, RendererName.GOURAUD, RendererName.INTERPOLANT, RendererName.GATHER)


class Told(StrEnum):
    """Whose estimate it is."""

    STATUS = "status"
    FLAT = "flat"
    GOURAUD = "gouraud"
    INTERPOLANT = "interpolant"
    GATHER = "gather"
    VPL = "vpl"
    PROBE = "probe"


@dataclass(frozen=True)
class Case:
    """One estimate."""

    told_by: Told
    scene: str
    stage: str
    told: float
    true: float
    noise: float
    """Standard error of the true error"""

    @property
    def ratio(self) -> float:
        """Told over true."""
        return self.told / max(self.true, _LEAST_TRUE)

    @property
    def holds(self) -> bool:
        """Whether the true error, less one standard error of its own, is no more than was told."""
        return self.told >= self.true - self.noise


@dataclass(frozen=True)
class SceneCases:
    """All estimates of a scene."""

    cases: tuple[Case, ...]


@dataclass(frozen=True)
class Effort:
    """Paths for what is taken as true."""

    field: int = 600_000
    """Of all elements"""
    pixel: int = 512
    probe: int = 16_384
    probes: int = 48
    tolerances: tuple[float, ...] = TOLERANCES


def scene_named(name: str) -> Scene:
    """A sample, or `room <seed>`."""
    kind, _, seed = name.partition(" ")
    return random_room(int(seed)) if kind == "room" else load_sample(name)


def measure_scene(name: str, effort: Effort) -> SceneCases:
    """Estimates of one scene from coarse to fine, while it is solved, and after an edit."""
    return SceneCases(tuple(_cases(name, effort)))


def _cases(name: str, effort: Effort) -> Iterator[Case]:
    scene = scene_named(name)
    settings = LightSettings(error_tolerance=effort.tolerances[0])
    engine = Engine(scene, settings, drawing=Drawing())
    truth: _Truth | None = None
    for tolerance in effort.tolerances:
        engine.configure(replace(settings, error_tolerance=tolerance))
        yield from _on_the_way(engine, name, f"{tolerance:g}", effort)
        _rest(engine)
        truth = truth or _Truth.of(engine, effort)
        yield from truth.cases(engine, name, f"{tolerance:g}, at rest")
    moved = next((o for o in engine.scene if o.id.startswith(("box", "tall", "cube", "part", "chair"))), None)
    if moved is not None:
        matrix = moved.transform.matrix.copy()
        matrix[:3, 3] += 0.1 * (engine._world.surfaces.center - moved.world_vertices.mean(axis=0)) * (1, 1, 0)
        place = TransformDocument(matrix=matrix.ravel().tolist())
        engine.apply([MoveEdit(op="move", id=moved.id, transform=place)])
        yield from _on_the_way(engine, name, "edited", effort)
        _rest(engine)
        yield from _Truth.of(engine, effort).cases(engine, name, "edited, at rest")


def _on_the_way(engine: Engine, name: str, stage: str, effort: Effort) -> Iterator[Case]:
    """The status while the solution is worked on, each time that it tells another error."""
    last = 1.0
    while engine.step(0.0):
        told = engine.status().error_estimate
        if told < last and isinstance(engine._solution.solver, RadiositySolver):
            last = told
            yield _status(engine, name, stage, effort.field // 4)


def _status(engine: Engine, name: str, stage: str, paths: int) -> Case:
    true = measured_error(engine._world, engine._solution.field(), paths)
    return Case(Told.STATUS, name, stage, engine.status().error_estimate, true.value, true.standard_error)


@dataclass(frozen=True, eq=False)
class _Truth:
    """What is true of a scene at pixels and points."""

    effort: Effort
    shown: Shown
    positions: Points
    normals: FloatArray
    first: FloatArray
    second: FloatArray

    @staticmethod
    def of(engine: Engine, effort: Effort) -> _Truth:
        world, field = engine._world, engine._solution.field()
        random = np.random.default_rng(1)
        leaf = random.choice(len(field.area), effort.probes, p=field.area / field.area.sum())
        weight = random.dirichlet(np.ones(3), effort.probes)
        positions = np.einsum("nk,nka->na", weight, field.corners[leaf, :3])
        normals = world.surfaces.normal[field.patch[leaf]]
        white = np.ones((effort.probes, 3))
        first, second = (
            true_luminance(world, positions, normals, white, effort.probe, seed) for seed in (3, 4)
        )
        shown = Shown.by(engine, world, _CAMERA, effort.pixel)
        return _Truth(effort, shown, positions, normals, first, second)

    def cases(self, engine: Engine, name: str, stage: str) -> Iterator[Case]:
        """All that a session at rest tells."""
        yield _status(engine, name, stage, self.effort.field)
        for renderer in (*_SHOWN, RendererName.VPL):
            request = FrameRequest(_CAMERA, renderer, LayerName.IRRADIANCE)
            while engine.outlook(request).improving and engine.step(_SLICE):
                pass
            frame = engine.frame(request)
            true = self.shown.error(np.asarray(frame.image, dtype=np.float64))
            yield Case(
                Told(renderer.value), name, stage, frame.outlook.error_estimate, true.value,
                true.standard_error,
            )  # fmt: skip
        found = engine.probe(self.positions, self.normals)
        light, true_light = found.irradiance @ LUMINANCE_WEIGHTS, 0.5 * (self.first + self.second)
        for n in np.flatnonzero(true_light > 0.0):
            error = float(abs(light[n] - true_light[n]) / true_light[n])
            noise = float(0.5 * abs(self.first[n] - self.second[n]) / true_light[n])
            yield Case(Told.PROBE, name, stage, float(found.error_estimate[n]), error, noise)


def _rest(engine: Engine) -> None:
    while engine.step(1.0):
        pass
