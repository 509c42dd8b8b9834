"""What one direction shows, and squares cut up for sums over them."""

from __future__ import annotations

import numpy as np

from solver.geometry.scene import Camera
from solver.pathtracing import PathTracer
from solver.types import FloatArray


def looking(
    eye: tuple[float, float, float], target: tuple[float, float, float], field: float = 0.01
) -> Camera:
    """A single pixel, so small that one direction is seen."""
    return Camera(np.array(eye), np.array(target), np.array([0.0, 1.0, 0.0]), field, 1, 1)


def radiance(
    of: PathTracer, camera: Camera, samples: int = 4, passes: int = 2
) -> tuple[FloatArray, FloatArray]:
    frame = of.frame(camera, samples, passes)
    frame.run()
    return frame.radiance[0, 0], frame.standard_error[0, 0]


def square_nodes(low: float, high: float, z: float) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) on a square at height z, and the area of each, m2."""
    nodes, weights = np.polynomial.legendre.leggauss(500)
    at, share = low + 0.5 * (high - low) * (nodes + 1.0), 0.5 * (high - low) * weights
    x, y = np.meshgrid(at, at)
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=-1), np.outer(share, share).ravel()
