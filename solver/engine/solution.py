"""The radiosity solution of one world in the making, and how it stands."""

from __future__ import annotations

import math

import numpy as np

from solver.engine.status import SessionState
from solver.engine.world import World
from solver.errors import SolverError
from solver.transport.field import RadiosityField, SolveOutcome
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from solver.types import LUMINANCE_WEIGHTS, ObjectId


class Solution:
    """A radiosity solver, what it has come to, and the error that stopped it, if one did."""

    def __init__(self, world: World, settings: SolverSettings, warm_start: Solution | None = None) -> None:
        """Begin where `warm_start`, the solution of an earlier revision, has got to, unless it failed."""
        self.world = world
        usable = warm_start is not None and warm_start.state is not SessionState.FAILED
        earlier = warm_start.solver if warm_start is not None and usable else None
        self.solver: RadiositySolver = RadiositySolver(world.surfaces, world.rays, settings, earlier)
        self._failure: SolverError | MemoryError | None = None
        self._field: RadiosityField | None = None
        self._field_version = -1

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; True while more work remains."""
        if self.state is not SessionState.SOLVING:
            return False
        try:
            return self.solver.step(budget)
        except (SolverError, MemoryError) as failure:
            self._failure = failure
            return False

    @property
    def state(self) -> SessionState:
        """How the solution stands."""
        if self._failure is not None:
            return SessionState.FAILED
        match self.solver.outcome:
            case SolveOutcome.RUNNING:
                return SessionState.SOLVING
            case SolveOutcome.CONVERGED:
                return SessionState.CONVERGED
            case _:
                return SessionState.PAUSED

    @property
    def version(self) -> int:
        """Counts the changes of the field."""
        return self.solver.version

    @property
    def error_estimate(self) -> float:
        """Estimated relative error of the field; 1 while nothing is known of it."""
        estimate = self.solver.error_estimate
        return estimate if math.isfinite(estimate) else 1.0

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know about this solution."""
        if self._failure is None:
            return self.solver.warnings
        reason = "out of memory" if isinstance(self._failure, MemoryError) else str(self._failure)
        return (*self.solver.warnings, f"The solve ended with an error: {reason}")

    def field(self) -> RadiosityField:
        """The field of the present version; the same object until the version changes."""
        if self._field is None or self._field_version != self.version:
            self._field, self._field_version = self.solver.field(), self.version
        return self._field

    def power_by_object(self) -> dict[ObjectId, float]:
        """W of luminance that leave the surfaces of each object; none is known of a failed solution."""
        if self.state is SessionState.FAILED:
            return {}
        field, surfaces = self.field(), self.world.surfaces
        leaving = field.area * (field.radiosity @ LUMINANCE_WEIGHTS)
        total = np.bincount(surfaces.object[field.patch], leaving, len(surfaces.object_ids))
        return dict(zip(surfaces.object_ids, total.tolist(), strict=True))
