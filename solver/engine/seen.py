"""What a camera sees, as points on patches: enough of them to weigh errors as a frame shows them."""

from __future__ import annotations

import math
import weakref
from collections import OrderedDict
from dataclasses import dataclass
from typing import Final, overload

import numpy as np

from solver.engine.cameras import camera_key
from solver.engine.solution import Solution
from solver.engine.world import World
from solver.geometry.scene import Camera
from solver.transport.places import leaves_at
from solver.transport.solve import RadiositySolver
from solver.transport.within import WithinElements
from solver.types import FloatArray, IntArray, Points

_COLUMNS: Final = 80
"""Points a row; there are as many rows as the shape of the frame makes them."""

_KEPT: Final = 8
"""Cameras whose points are kept"""

_SAFETY: Final = 1.25
"""Factor on what elements vary by within them: peaks below lamps are sharper than their links tell."""

_DIM: Final = 0.7
"""Light, relative to its RMS, below which relative errors are larger than in the RMS."""

_DARK: Final = 0.7
"""Power by which they grow with darkness."""


@dataclass(frozen=True, eq=False)
class SeenPoints:
    """The k points of a coarse grid over a frame that lie on fronts."""

    patch: IntArray
    """(k,)"""
    positions: Points
    """(k, 3)"""

    @staticmethod
    def of(camera: Camera, world: World) -> SeenPoints:
        """What `camera` sees of `world`."""
        columns = min(_COLUMNS, camera.width)
        rows = max(1, round(columns * camera.height / camera.width))
        across, up, along = camera.basis()
        tall = math.tan(math.radians(0.5 * camera.vertical_fov))
        x = ((np.arange(columns) + 0.5) / columns * 2.0 - 1.0) * tall * camera.width / camera.height
        y = (1.0 - (np.arange(rows) + 0.5) / rows * 2.0) * tall
        directions = (x[None, :, None] * across + y[:, None, None] * up + along).reshape(-1, 3)
        hits = world.rays.intersect(np.broadcast_to(camera.eye, directions.shape), directions)
        hit = np.flatnonzero(hits.triangle >= 0)
        positions = camera.eye + directions[hit] * hits.distance[hit, None]
        patch = _fronts(world, hits.triangle[hit], camera.eye)
        kept = np.flatnonzero(patch >= 0)
        return SeenPoints(patch[kept], positions[kept])


def _fronts(world: World, triangle: IntArray, eye: FloatArray) -> IntArray:
    """The patch (k,) that is seen of each triangle (k,), -1 for a black back."""
    surfaces = world.surfaces
    a, b, c = np.moveaxis(surfaces.triangles[triangle], 1, 0)
    before = np.einsum("ka,ka->k", np.cross(b - a, c - a), eye - a) > 0.0
    sides = surfaces.triangle_patch[triangle]
    return np.where(before, sides[:, 0], sides[:, 1]).astype(np.int32)


@dataclass(frozen=True)
class SeenLight:
    """How the light that a frame shows is different from that of all surfaces."""

    linear: float = 0.0
    """Square of what elements vary by linearly, relative to that of the light"""
    residual: float = 0.0
    """The same of what varies in any other way"""
    level: float = 1.0
    """RMS of the reflected light, relative to that of all surfaces"""

    def of_field(self, error: float) -> float:
        """The error of the light that is shown, where that of the light of all surfaces is known."""
        return min(1.0, error * darkness(self.level))

    def of_elements(self, error: float) -> float:
        """The error of a picture of elements, where that of the light of all surfaces is known.

        A picture that shows each element as constant leaves out what the light varies by within it. One that
        interpolates leaves out what is not linear, and where that matters most, below lamps, is not better.
        """
        shown = math.sqrt(self.of_field(error) ** 2 + _SAFETY**2 * (self.linear + self.residual))
        return min(1.0, shown)


@overload
def darkness(level: float) -> float: ...
@overload
def darkness(level: FloatArray) -> FloatArray: ...
def darkness(level: float | FloatArray) -> float | FloatArray:
    """How much larger relative errors are where light is `level` times as strong as in the RMS.

    What dark places lack comes from the bright ones, whose errors are large in proportion to them.
    """
    with np.errstate(divide="ignore"):
        factor = np.maximum(1.0, (_DIM / np.asarray(level)) ** _DARK)
    return float(factor) if factor.ndim == 0 else factor


class SeenErrors:
    """What cameras see of a solution, for as long as the solve has not told its error anew."""

    def __init__(self) -> None:
        self._world: World | None = None
        self._points: OrderedDict[tuple[float, ...], SeenPoints] = OrderedDict()
        self._told: dict[tuple[float, ...], tuple[object, SeenLight]] = {}
        self._within: tuple[object, WithinElements, FloatArray, float] | None = None

    def light(self, camera: Camera, solution: Solution) -> SeenLight:
        """What `camera` sees. Of a sampled solution, whose error holds for every element, nothing is told."""
        solver = solution.solver
        if not isinstance(solver, RadiositySolver):
            return SeenLight()
        key, moment = camera_key(camera), (weakref.ref(solver), solver.estimates, solution.state)
        told = self._told.get(key)
        # An edit has changed little of the picture: until the error is told anew, what was known stays.
        if told is not None and (told[0] == moment or solver.estimates == 0):
            return told[1]
        found = self._light(self._seen(camera, solution.world), solver, moment)
        if len(self._told) >= _KEPT and key not in self._told:
            self._told.pop(next(iter(self._told)))
        self._told[key] = moment, found
        return found

    def _light(self, seen: SeenPoints, solver: RadiositySolver, moment: object) -> SeenLight:
        tree = solver.state.tree
        # Elements come and go between two estimates, while views that are new ask.
        whole = moment, tree, len(tree)
        if self._within is None or self._within[0] != whole:
            self._within = whole, *_within(solver)
        _, within, square, mean_square = self._within
        if len(seen.patch) == 0:
            return SeenLight()
        leaves = leaves_at(tree, seen.positions, seen.patch)
        light = float(square[leaves].mean())
        if light <= 0.0:
            return SeenLight()
        linear, residual = within.over(leaves)
        return SeenLight(linear / light, residual / light, math.sqrt(light / mean_square))

    def _seen(self, camera: Camera, world: World) -> SeenPoints:
        if self._world is not world:
            self._world = world
            self._points.clear()
        key = camera_key(camera)
        if key not in self._points:
            self._points[key] = SeenPoints.of(camera, world)
            if len(self._points) > _KEPT:
                self._points.popitem(last=False)
        return self._points[key]


def _within(solver: RadiositySolver) -> tuple[WithinElements, FloatArray, float]:
    """The variation within elements (n,), the mean square of their light (n,), and that of all surfaces."""
    state = solver.state
    within = WithinElements.of(state)
    reflectance = (state.reflectance @ state.weights)[state.tree.patch]
    square = (reflectance * (state.received[:, 0] @ state.weights)) ** 2 + within.linear
    leaves = state.tree.leaves
    area = state.tree.area[leaves]
    return within, square, float(area @ square[leaves] / max(float(area.sum()), 1e-300))
