"""A path-traced frame that improves for as long as it is given time."""

from __future__ import annotations

import numpy as np

from solver.geometry.scene import Camera
from solver.pathtracing.estimate import ProgressiveEstimate
from solver.types import LUMINANCE_WEIGHTS, FloatArray


class PathTracedFrame:
    """Radiance of a camera's pixels, box filtered, with its standard error."""

    def __init__(self, camera: Camera, estimate: ProgressiveEstimate) -> None:
        self.camera = camera
        self._estimate = estimate
        self._shape = (camera.height, camera.width, 3)

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds of wall time on all cores; True while more can be done."""
        return self._estimate.step(budget)

    def run(self) -> None:
        """Work until all passes are done; only for a frame with a number of passes."""
        self._estimate.run()

    @property
    def passes(self) -> int:
        """Passes complete over the whole frame."""
        return self._estimate.passes

    @property
    def samples(self) -> int:
        """Samples of every pixel, at least."""
        return self._estimate.passes * self._estimate.samples_per_pass

    @property
    def radiance(self) -> FloatArray:
        """(height, width, 3) W/(m2 sr), top row first; 0 in pixels that the first pass has not reached."""
        return self._estimate.mean.reshape(self._shape)

    @property
    def standard_error(self) -> FloatArray:
        """(height, width, 3) of the radiance; infinite in pixels with fewer than two passes."""
        return self._estimate.standard_error.reshape(self._shape)

    @property
    def error_estimate(self) -> float:
        """Relative RMS luminance error of the frame that its standard errors tell; infinite at first.

        Channels share their paths, so their errors are taken as fully correlated: not less than the truth.
        """
        if self.passes < 2:
            return float("inf")
        noise = self.standard_error @ LUMINANCE_WEIGHTS
        signal = self.radiance @ LUMINANCE_WEIGHTS
        power = float(np.sum(signal**2))
        return float(np.sqrt(np.sum(noise**2) / power)) if power > 0.0 else 0.0

    @property
    def ray_count(self) -> int:
        """Rays traced so far, shadow rays included."""
        return self._estimate.ray_count

    @property
    def vertex_count(self) -> int:
        """Path vertices reached so far."""
        return self._estimate.vertex_count
