"""The path tracer of a scene: frames, irradiance at points, mean irradiance of elements.

Everything it reports is unbiased but for two roundings of visibility, both of the order of the ray
offset (2e-6 of the scene's size): vertices are lifted off their surfaces by it, and Embree decides in
float32.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.geometry.scene import Camera
from solver.geometry.surfaces import Surfaces
from solver.pathtracing.estimate import ProgressiveEstimate
from solver.pathtracing.frame import PathTracedFrame
from solver.pathtracing.sources import CameraSource, ElementSource, PointSource, Source
from solver.pathtracing.tables import build_tables
from solver.types import Corners, FloatArray, IntArray, Points
from solver.visibility.rays import RayScene

PASSES: Final = 32
"""Independent passes into which the samples of a fixed-size estimate are dealt; its standard error has
one degree of freedom less."""


class PathTracer:
    """Unbiased estimates over the surfaces of one scene."""

    def __init__(self, surfaces: Surfaces, rays: RayScene, seed: int = 0) -> None:
        """`rays` must hold `surfaces.triangles`. Equal seeds give equal numbers."""
        self.surfaces = surfaces
        self._rays = rays
        self._seed = seed
        self._tables, self._emitters = build_tables(surfaces, rays)

    def frame(self, camera: Camera, samples_per_pass: int = 4, passes: int | None = None) -> PathTracedFrame:
        """A frame to be stepped: nothing is traced yet. Without `passes` it can go on for ever.

        `samples_per_pass` samples of a pixel are stratified together; powers of two serve best.
        """
        return PathTracedFrame(camera, self._estimate(CameraSource(camera), samples_per_pass, passes))

    def irradiance(
        self, positions: Points, normals: FloatArray, samples: int
    ) -> tuple[FloatArray, FloatArray]:
        """Irradiance at points (n, 3) with unit normals (n, 3), from at least `samples` paths each.

        Returns mean and standard error, (n, 3) each, W/m2. A point may lie on a surface: it is lifted
        off along its normal.
        """
        source = PointSource(np.ascontiguousarray(positions), np.ascontiguousarray(normals))
        return self._run(source, samples)

    def mean_irradiance(
        self, corners: Corners, corner_count: IntArray, patch: IntArray, samples: int
    ) -> tuple[FloatArray, FloatArray]:
        """Area-averaged irradiance of elements (n, 4, 3) on patches (n,), from at least `samples` paths each.

        Returns mean and standard error, (n, 3) each, W/m2. Elements are planar and convex; a triangle
        repeats its last corner.
        """
        return self._run(ElementSource.of(corners, corner_count, self.surfaces.normal[patch]), samples)

    def element_pass(
        self, corners: Corners, corner_count: IntArray, patch: IntArray, samples: int, number: int
    ) -> ProgressiveEstimate:
        """One pass of `samples` paths over elements (n, 4, 3), to be stepped; its mean is their irradiance.

        Passes of different `number` are independent, and so are the elements, the same one twice included.
        """
        source = ElementSource.of(corners, corner_count, self.surfaces.normal[patch])
        seed = int(np.random.SeedSequence((self._seed, number)).generate_state(1)[0])
        return ProgressiveEstimate(self._rays, self._tables, self._emitters, source, samples, seed, 1)

    def _estimate(self, source: Source, samples: int, passes: int | None) -> ProgressiveEstimate:
        return ProgressiveEstimate(
            self._rays, self._tables, self._emitters, source, samples, self._seed, passes
        )

    def _run(self, source: Source, samples: int) -> tuple[FloatArray, FloatArray]:
        estimate = self._estimate(source, max(1, -(-samples // PASSES)), PASSES)
        estimate.run()
        return estimate.mean, estimate.standard_error
