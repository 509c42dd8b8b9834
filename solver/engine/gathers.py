"""Frames whose irradiance is computed anew at every pixel: the yardstick of interpolants ([H B.3.3])."""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from solver.engine.cameras import camera_key
from solver.engine.drawing import Drawing
from solver.engine.requests import LayerName, RendererName
from solver.engine.world import World
from solver.geometry.scene import Camera
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.transport.field import RadiosityField
from solver.transport.pace import Pace
from solver.types import FloatArray, IntArray

KEPT: Final = 2
"""Frames kept at once; a new one takes the place of the one asked for longest ago."""


class GatherFrame:
    """One frame in the making."""

    def __init__(
        self,
        world: World,
        field: RadiosityField,
        point: PointIrradiance,
        drawing: Drawing,
        camera: Camera,
        samples: int,
    ) -> None:
        """Find out what each pixel sees, at the centres of `samples` squares of it, rounded up to a square.

        Raises RenderingUnavailableError, LimitExceededError.
        """
        k = math.ceil(math.sqrt(samples))
        self._shape = (camera.height, k, camera.width, k)
        fine = replace(camera, width=k * camera.width, height=k * camera.height)
        # Identity of leaves and exact positions do not depend on the light.
        self._leaf = drawing.draw(world, field, fine, RendererName.FLAT, LayerName.ELEMENT, 1).ravel()
        position = drawing.draw(world, field, fine, RendererName.FLAT, LayerName.POSITION, 1)
        self._position = np.ascontiguousarray(position.reshape(-1, 3))
        seen = np.flatnonzero(self._leaf >= 0)
        patch = field.patch[self._leaf[seen]]
        eye_side = np.einsum(
            "na,na->n", camera.eye - world.surfaces.corners[patch, 0], world.surfaces.normal[patch]
        )
        self._todo: IntArray = seen[eye_side > 0.0].astype(np.int32)
        self._world, self._field, self._point = world, field, point
        self._irradiance = np.zeros((len(self._leaf), 3))
        # Until a pixel has its own, it has the solution's.
        at = point.tree.leaves[self._leaf[self._todo]]
        self._irradiance[self._todo] = np.maximum(point.solved(self._position[self._todo], at), 0.0)
        self.done = 0
        self._work = self._run()

    @property
    def is_complete(self) -> bool:
        """Whether every pixel has its light."""
        return self.done == len(self._todo)

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; True while more remains."""
        start = time.perf_counter()
        while not self.is_complete and time.perf_counter() - start < budget:
            next(self._work, None)
        return not self.is_complete

    def _run(self) -> Iterator[None]:
        elements = self._point.tree.leaves
        for part in Pace().batches(np.ones(len(self._todo), dtype=np.int64)):
            chosen = self._todo[part]
            self._irradiance[chosen] = self._point.at(self._position[chosen], elements[self._leaf[chosen]])
            self.done += len(chosen)
            yield

    def image(self, layer: LayerName) -> FloatArray:
        """Irradiance (h, w, 3) in W/m2, or radiance in W/(m2 sr) of what has been computed."""
        light = self._irradiance
        if layer is LayerName.RADIANCE:
            light = np.zeros_like(light)
            patch, surfaces = self._field.patch[self._leaf[self._todo]], self._world.surfaces
            lit = surfaces.emission[patch] + surfaces.reflectance[patch] * self._irradiance[self._todo]
            light[self._todo] = lit / math.pi
        return np.asarray(light.reshape(*self._shape, 3).mean(axis=(1, 3)), dtype=np.float32)


class GatherFrames:
    """The gathered frames of one solution at rest."""

    def __init__(self, world: World, field: RadiosityField, point: PointIrradiance, drawing: Drawing) -> None:
        self._from = (world, field, point, drawing)
        self._asked: OrderedDict[tuple[float, ...], GatherFrame] = OrderedDict()

    def ask(self, camera: Camera, samples: int) -> GatherFrame:
        """The frame of `camera` as it stands; it is worked on from now on."""
        key = (*camera_key(camera), samples)
        known = self._asked.get(key)
        if known is None:
            known = self._asked[key] = GatherFrame(*self._from, camera, samples)
        self._asked.move_to_end(key)
        while len(self._asked) > KEPT:
            self._asked.popitem(last=False)
        return known

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds on the frame asked for last; False if none needs work."""
        for frame in reversed(self._asked.values()):
            if not frame.is_complete:
                frame.step(budget)
                return True
        return False
