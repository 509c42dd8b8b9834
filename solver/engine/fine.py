"""Fine light: the interpolants of a settled solution, for the cameras that are in use.

The work begins when a solution rests and somebody looks at it: what the links missed is put back, the
discontinuities are found and weighed, the leaves are triangulated, and interpolants are built where a
camera looks, until the picture is within the tolerance. It ends there, and goes on for the next camera.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Iterator
from typing import Final

import numpy as np

from solver.engine.cameras import camera_key
from solver.engine.checkpoint import Checkpoint
from solver.engine.checkpoint_fine import KeptInterpolants, with_interpolants
from solver.engine.drawing import Drawing
from solver.engine.solution import Solution
from solver.engine.status import FineStatistics
from solver.errors import SolverError
from solver.geometry.scene import Camera
from solver.illumination.discontinuity.lines import Lines, find_lines
from solver.illumination.interpolation.correction import corrected
from solver.illumination.interpolation.following import Following
from solver.illumination.interpolation.interpolants import Interpolants
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.illumination.interpolation.refinement import (
    ViewError,
    cells_to_split,
    has_urgent_cells,
    view_error,
)
from solver.illumination.meshing.cells import Cells
from solver.illumination.meshing.splitting import split_cells
from solver.illumination.meshing.triangulation import Triangulation, triangulate_in_steps
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.illumination.settings import LightSettings
from solver.transport.settings import Saving
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray, IntArray

KEPT: Final = 4
"""Cameras kept in mind at once; a new one takes the place of the one asked for longest ago."""

_FAILURES: Final = (SolverError, ArithmeticError, LookupError, MemoryError, RuntimeError, ValueError)
"""What libraries raise over geometry that they cannot bear; the solution itself is none the worse."""

_GATHER_ERROR: Final = 0.8
"""Error of point irradiance from a corrected solution over what a camera sees, relative to the estimated
error of the solution: 0.3 in the median of many rooms, less than this in 19 of 20."""

_MADE_READY: Final = 20_000
"""Triangles: what follows an edit is not made ready of more, which would take longer than a step may"""

_LAST: Final = 1e-9
"""Fewer pixels than any triangle has that is seen."""

_FIRST: Final = 1e9
"""More pixels than any camera has."""


class FineLight:
    """The interpolants of one solution in the making."""

    def __init__(
        self,
        solution: Solution,
        drawing: Drawing,
        settings: LightSettings,
        before: Interpolants | None = None,
        kept: Checkpoint | None = None,
    ) -> None:
        """Nothing is built yet; what edits left as it was is taken over from the interpolants `before`, and
        what was `kept` with this very solution is gone on from.

        Raises ValueError for a sampled solution.
        """
        self.version = 0
        """Counts the changes of what can be drawn."""
        self.failure: str | None = None
        """What to tell a user where the work met an error that it cannot go on from."""
        self._solution = solution
        if not isinstance(solution.solver, RadiositySolver):
            raise ValueError("interpolants are made over links, which a sampled solution does not have")
        self._solver = solution.solver
        self._drawing = drawing
        self._settings = settings
        self._cameras: OrderedDict[tuple[float, ...], Camera] = OrderedDict()
        self._seen: dict[tuple[float, ...], FloatArray] = {}
        self._before = before
        self._kept = KeptInterpolants.of(kept, self._solver, settings)
        self._taken_over = 0
        self._interpolants: Interpolants | None = None
        self._lines: Lines | None = None
        self._point: PointIrradiance | None = None
        self._following: Following | None = None
        self._evaluations = 0
        self._is_resting = False
        self._is_preparing = False
        self._work = self._run()

    # --- what it holds -------------------------------------------------------------------------------

    @property
    def solution(self) -> Solution:
        """The solution that it is of."""
        return self._solution

    @property
    def interpolants(self) -> Interpolants | None:
        """The interpolants; None until there are any."""
        return self._interpolants

    @property
    def point_irradiance(self) -> PointIrradiance | None:
        """Point irradiance by the corrected solution; None until it is."""
        return self._point

    @property
    def lines(self) -> Lines | None:
        """The discontinuities; None until they have been found."""
        return self._lines

    def statistics(self) -> FineStatistics:
        """Counts at this moment."""
        interpolants, lines = self._interpolants, self._lines
        told = None if lines is None else lines.activation.statistics
        return FineStatistics(
            discontinuities=0 if told is None else told.found,
            discontinuities_active=0 if told is None else told.active,
            discontinuities_weak=0 if told is None else told.dropped_by_weight,
            discontinuities_crowded=0 if told is None else told.dropped_by_limit,
            triangles=0 if interpolants is None else len(interpolants.triangulation.triangles),
            interpolants=0 if interpolants is None else int(interpolants.is_fine.sum()),
            taken_over=self._taken_over,
            point_irradiances=self._evaluations + (0 if interpolants is None else interpolants.evaluations),
        )

    def mesh(self) -> InterpolantMesh | None:
        """What to draw; None until there is anything."""
        return None if self._interpolants is None else self._interpolants.mesh()

    def interpolation_error(self, camera: Camera) -> float | None:
        """Relative error that interpolants add to the irradiance that `camera` sees; None before any is."""
        seen = self._error_seen(camera)
        return None if seen is None else seen.relative

    def is_complete(self, camera: Camera) -> bool:
        """Whether all that `camera` sees is built, and no cell is to be split for it."""
        seen = self._error_seen(camera)
        return seen is not None and seen.share_known >= 1.0 and self._is_resting

    @property
    def gather_error(self) -> float:
        """Estimated relative error of point irradiances."""
        return _GATHER_ERROR * self._solution.error_estimate

    def kept(self, checkpoint: Checkpoint) -> Checkpoint:
        """A checkpoint of the solution, with the interpolants where all that was asked for is built."""
        if self._interpolants is None or not self._is_resting or self.failure is not None:
            return checkpoint
        return with_interpolants(checkpoint, self._interpolants, self._settings)

    def following(self) -> Following | None:
        """What can be shown of the interpolants after an edit; None where there are none.

        Made ready when they are complete, so that the first frame after the edit need not wait for it.
        """
        if self._interpolants is None:
            return None
        known = self._following
        if known is None or not known.is_of(self._interpolants):
            known = self._following = Following(self._interpolants, self._solver.state)
        return known

    # --- the work ------------------------------------------------------------------------------------

    def prepare(self) -> PointIrradiance | None:
        """Point irradiance by the corrected solution; None until it is, which is seen to from now on."""
        self._is_preparing = self._point is None
        return self._point

    def ask(self, camera: Camera) -> None:
        """Build what `camera` sees, from now on."""
        key = camera_key(camera)
        is_new = key not in self._cameras
        self._cameras[key] = camera
        self._cameras.move_to_end(key)
        while len(self._cameras) > KEPT:
            gone, _ = self._cameras.popitem(last=False)
            self._seen.pop(gone, None)
        if is_new and self._interpolants is not None:
            self._look(self._interpolants)
            self._is_resting = False

    def build(self, triangles: IntArray) -> None:
        """Build these triangles (m,) of the interpolants that there are, before all that cameras see."""
        if self._interpolants is not None:
            wanted = np.zeros(len(self._interpolants.triangulation.triangles))
            wanted[triangles] = _FIRST
            self._interpolants.want(wanted)
            self._is_resting = False

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; False if nothing needed any."""
        start = time.perf_counter()
        needed = self._has_work()
        try:
            while self._has_work():
                next(self._work)
                if time.perf_counter() - start >= budget:
                    break
        except _FAILURES as failure:
            reason = "out of memory" if isinstance(failure, MemoryError) else str(failure)
            self.failure = f"Interpolants cannot be built for this scene; frames show its elements: {reason}"
            self._interpolants = None
            self.version += 1
        return needed

    def _has_work(self) -> bool:
        if self.failure is not None:
            return False
        preparing = self._is_preparing and self._point is None
        return preparing or (bool(self._cameras) and not self._is_resting)

    def _run(self) -> Iterator[None]:
        surfaces = self._solution.world.surfaces
        state, hierarchy = self._solver.state, self._solver.hierarchy
        point = yield from PointIrradiance.in_steps(state, hierarchy, self._settings.point_accuracy)
        state = yield from corrected(state, point)
        point = self._point = point.of_light(state)
        yield
        field = self._solution.field()
        kept, self._kept = self._kept, None
        cells = Cells.of(field) if kept is None else kept.cells()
        self._lines = yield from find_lines(state, hierarchy, field, self._settings)
        before, trace = self._before, self._solution.trace()
        triangulation: Triangulation | None = None if before is None else before.triangulation
        while True:
            edges = self._lines.edges
            triangulation = yield from triangulate_in_steps(cells, surfaces, edges, triangulation)
            yield
            interpolants = Interpolants(
                point, state.tree.leaves, cells, triangulation, field.irradiance, self._interpolants
            )
            if self._interpolants is not None:
                self._evaluations += self._interpolants.evaluations
            elif before is not None and trace is not None:
                doubt = trace.at_elements(state.tree)[state.tree.leaves]
                self._taken_over = interpolants.follow(before, trace.patch, doubt)
                self._before = None
            if kept is not None:
                kept.restore(interpolants)
                kept = None
            self._interpolants = interpolants
            self._look(interpolants)
            yield
            finer = cells
            while finer is cells:
                while interpolants.step():
                    self.version += 1
                    yield
                    if interpolants.is_between and self._is_urgent(interpolants):
                        break
                finer = self._split(interpolants, cells)
                if finer is cells:
                    if len(triangulation.triangles) <= _MADE_READY:
                        self.following()
                    self._is_resting = True
                    yield
            cells = finer

    def _split(self, interpolants: Interpolants, cells: Cells) -> Cells:
        if self._is_full(interpolants):
            return cells
        tolerance = self._settings.interpolation_tolerance
        chosen = np.zeros(len(cells.patch), dtype=np.bool_)
        for pixels in self._seen.values():
            chosen |= cells_to_split(interpolants, pixels, tolerance)
        return split_cells(cells, chosen) if chosen.any() else cells

    def _is_full(self, interpolants: Interpolants) -> bool:
        return len(interpolants.triangulation.triangles) > self._settings.max_triangles

    def _is_urgent(self, interpolants: Interpolants) -> bool:
        if self._is_full(interpolants):
            return False
        tolerance = self._settings.interpolation_tolerance
        return any(has_urgent_cells(interpolants, pixels, tolerance) for pixels in self._seen.values())

    def _look(self, interpolants: Interpolants) -> None:
        """Tell the interpolants what the cameras see."""
        self._seen.clear()
        for key, camera in self._cameras.items():
            pixels = self._drawing.pixels_by_triangle(interpolants.mesh(), camera)
            self._seen[key] = pixels
            interpolants.want(pixels)
        if Saving.INTERPOLANTS in self._settings.in_full:
            # After all that cameras see.
            interpolants.want(np.full(len(interpolants.triangulation.triangles), _LAST))
        self.version += 1

    def _error_seen(self, camera: Camera) -> ViewError | None:
        pixels = self._seen.get(camera_key(camera))
        if self._interpolants is None or pixels is None:
            return None
        return view_error(self._interpolants, pixels)
