"""Lightmaps by the radiosity solution, once it rests and is corrected."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from solver.engine.lightmaps.bake import Bake, Gather, LightmapRequest, LightmapSource
from solver.engine.world import World
from solver.illumination.lightmaps.texels import Texels
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.transport.pace import Pace
from solver.transport.places import leaves_at
from solver.types import Float32Array

MOST_GATHERED: Final = 2**16
"""Texels that the exact gather is made for unless it is asked for; 5 seconds in a box, 15 in an office."""

_PART: Final = 1 << 15
"""Texels whose light is read off the solution between two yields."""


class SolutionBake(Bake):
    """Texels have the solution's own functions at first, and then exact gathers, one after the other."""

    source = LightmapSource.RADIOSITY

    def __init__(
        self,
        world: World,
        revision: int,
        request: LightmapRequest,
        point: PointIrradiance,
        errors: tuple[float, float],
        tolerance: float,
    ) -> None:
        """`errors`: the estimated ones of the solution, and of exact gathers from it."""
        super().__init__(world, revision, request)
        self._point = point
        self._errors = errors
        self._tolerance = tolerance
        self._found = np.zeros((0, 3), dtype=np.float32)
        self._is_exact = False
        self._read = self._gathered = 0

    @property
    def is_drawable(self) -> bool:
        """Once the solution has been read at all texels."""
        return self._texels is not None and self._read == len(self._texels)

    @property
    def progress(self) -> float:
        """Share of the texels that have their light."""
        if self.is_over:
            return 1.0
        done = self._gathered if self._is_exact else self._read
        return done / max(1, len(self._found))

    @property
    def error_estimate(self) -> float:
        """Of the solution, or of the gathers once all are made."""
        return self._errors[self._is_exact and self.is_over]

    @property
    def converged(self) -> bool:
        """Whether all is done, and within the tolerance."""
        return self.is_over and self.error_estimate <= self._tolerance

    @property
    def method(self) -> str:
        """Where the light of all texels is from."""
        return str(Gather.EXACT if self._is_exact and self.is_over else Gather.SOLUTION)

    def _irradiance(self) -> Float32Array:
        return self._found

    def _light(self, texels: Texels) -> Iterator[None]:
        count, point = len(texels), self._point
        asked = self._request.gather
        self._is_exact = asked is Gather.EXACT or (asked is Gather.AUTO and count <= MOST_GATHERED)
        self._found = np.zeros((count, 3), dtype=np.float32)
        while self._read < count:
            part = slice(self._read, min(count, self._read + _PART))
            self._found[part] = point.at_patches(texels.position[part], texels.patch[part])
            self._read = part.stop
            yield
        if not self._is_exact:
            return
        for part in Pace().batches(np.ones(count, dtype=np.int64)):
            position = texels.position[part]
            self._found[part] = point.at(position, leaves_at(point.tree, position, texels.patch[part]))
            self._gathered = part.stop
            yield
