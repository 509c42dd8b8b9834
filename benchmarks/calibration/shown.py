"""The true error of what a frame or a probe shows, point by point, against the path tracer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.witness import MeasuredError, error_of
from solver.engine.engine import Engine
from solver.engine.requests import CameraChoice, FrameRequest, LayerName, RendererName
from solver.engine.world import World
from solver.pathtracing import PathTracer
from solver.types import LUMINANCE_WEIGHTS, FloatArray, IntArray, Points


@dataclass(frozen=True, eq=False)
class Shown:
    """The n pixels of a frame that show a front that reflects, and their true light twice."""

    rows: IntArray
    columns: IntArray
    reflectance: FloatArray
    """(n, 3)"""
    first: FloatArray
    """(n,) reflected luminance, W/m2, by paths"""
    second: FloatArray
    """(n,) the same, independently"""

    @staticmethod
    def by(engine: Engine, world: World, camera: CameraChoice, paths: int) -> Shown:
        """What `camera` sees, with that many paths from each pixel, twice."""
        request = FrameRequest(camera, RendererName.GOURAUD, LayerName.POSITION)
        positions = np.asarray(engine.frame(request).image, dtype=np.float64)
        request = FrameRequest(camera, RendererName.GOURAUD, LayerName.ELEMENT)
        element = np.asarray(engine.frame(request).image)
        field = engine._solution.field()
        rows, columns = (index.astype(np.int32) for index in np.nonzero(element >= 0))
        patch = field.patch[element[rows, columns]]
        surfaces = world.surfaces
        reflectance = surfaces.reflectance[patch]
        eye = camera.resolve(world.scene).eye
        place = positions[rows, columns]
        faces = np.einsum("na,na->n", eye - place, surfaces.normal[patch]) > 0.0
        kept = np.flatnonzero(faces & (reflectance.max(axis=1) > 0.0))
        place, normal, reflectance = place[kept], surfaces.normal[patch[kept]], reflectance[kept]
        first, second = (true_luminance(world, place, normal, reflectance, paths, seed) for seed in (1, 2))
        return Shown(rows[kept], columns[kept], reflectance, first, second)

    def error(self, irradiance: FloatArray) -> MeasuredError:
        """The error of a frame's irradiance (height, width, 3)."""
        found = (self.reflectance * irradiance[self.rows, self.columns]) @ LUMINANCE_WEIGHTS
        return error_of(found, self.first, self.second, np.ones(len(found)))


def true_luminance(
    world: World, positions: Points, normals: FloatArray, reflectance: FloatArray, paths: int, seed: int
) -> FloatArray:
    """Reflected luminance (n,) W/m2 at points (n, 3), from that many paths each."""
    tracer = PathTracer(world.surfaces, world.rays, seed)
    found, _ = tracer.irradiance(positions, normals, paths)
    return np.asarray((reflectance * found) @ LUMINANCE_WEIGHTS)
