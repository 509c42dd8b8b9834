"""The radiosity solution of one world in the making, and how it stands."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Final

import numpy as np

from solver.engine.checkpoint import Checkpoint, checkpoint_of, solver_of
from solver.engine.sampled import SampledSolver
from solver.engine.status import SessionState
from solver.engine.world import World
from solver.errors import SolverError
from solver.geometry.surfaces import Surfaces
from solver.redistribution.memory import Memory
from solver.redistribution.redistribution import Redistribution
from solver.redistribution.trace import Trace
from solver.transport.field import RadiosityField, SolveOutcome
from solver.transport.settings import SolverSettings
from solver.transport.solve import RadiositySolver
from solver.types import LUMINANCE_WEIGHTS, ObjectId

MOST_LINKED: Final = 3000
"""Patches of a scene that is solved over links, at most; the light of a larger one is sampled. Linking starts
from all pairs: 2,000 patches of an office take 5 s, 3,000 15 s and 1.2 million links, 4,000 over 55 s and
2.3 million."""


class Solution:
    """A solver, what it has come to, and the error that stopped it, if one did."""

    def __init__(
        self,
        world: World,
        settings: SolverSettings,
        earlier: Solution | None = None,
        number: int = 1,
        drags: bool = False,
        memory: Memory | None = None,
        anew: bool = True,
        kept: Checkpoint | None = None,
    ) -> None:
        """Go on from `earlier`, the solution of an earlier revision, which is used up, unless it failed.

        `number` of the edit in between, which moves on what the one before moved, and nothing else, if it
        `drags`; what it does to the light is traced `anew`. A solution that `memory` has is taken from there;
        it is shown this one when it has settled. One that was `kept` is gone on from, if it is of this world.
        """
        self.world = world
        self.solver: RadiositySolver | SampledSolver
        """Over links, or by samples where there are too many patches, which begins anew after every edit"""
        self._lent = False
        surfaces, rays = world.surfaces, world.rays
        self._memory = memory or Memory(0)
        self._remembering: Iterator[None] | None = None
        before = None if earlier is None else earlier.handed_over()
        recalled = None if kept is None else solver_of(kept, surfaces, rays, settings)
        recalled = recalled or self._memory.recall(surfaces, rays, settings)
        if recalled is not None:
            self.solver = recalled
        elif surfaces.patch_count > MOST_LINKED:
            self.solver = SampledSolver(surfaces, rays, settings)
        elif before is None:
            self.solver = RadiositySolver(surfaces, rays, settings)
        else:
            self.solver = Redistribution(surfaces, rays, settings, before, number, drags, anew)
        self._beyond_diffuse = _beyond_diffuse(world.surfaces, self.is_sampled)
        self._failure: SolverError | MemoryError | None = None
        self._field: RadiosityField | None = None
        self._field_version = -1

    def trace(self) -> Trace | None:
        """What edits have done to the light since it was last traced anew; None where that is not known."""
        return self.solver.trace if isinstance(self.solver, Redistribution) else None

    def lend(self) -> None:
        """Let somebody read the solver's state for longer than the next edit may come."""
        self._lent = True

    def handed_over(self) -> RadiositySolver | None:
        """The solver for the next revision to use up; None where there is nothing to go on from."""
        solver = self.solver
        if self._failure is not None or not isinstance(solver, RadiositySolver):
            return None
        if self._lent:
            solver.keep_a_copy()
        return solver

    def checkpoint(self) -> Checkpoint | None:
        """What is to be kept of it; None while it does not rest, or where it failed."""
        return None if self._failure is not None else checkpoint_of(self.solver)

    def step(self, budget: float) -> bool:
        """Work for about `budget` seconds; True while more work remains."""
        if self.state is SessionState.CONVERGED:
            return self._remember(budget)
        if self.state is not SessionState.SOLVING:
            return False
        try:
            return self.solver.step(budget)
        except (SolverError, MemoryError) as failure:
            self._failure = failure
            return False

    def _remember(self, budget: float) -> bool:
        if not isinstance(self.solver, RadiositySolver):
            return False
        if self._remembering is None:
            self._remembering = self._memory.remember(self.solver)
        start = time.perf_counter()
        return any(time.perf_counter() - start >= budget for _ in self._remembering)

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
    def is_sampled(self) -> bool:
        """Whether its light is sampled: there are no links, nor what is made of them."""
        return isinstance(self.solver, SampledSolver)

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
        told = self.solver.warnings
        if self.is_sampled:
            told = (*told, _sampled_warning(self.world.surfaces.patch_count))
        told = (*told, *self._beyond_diffuse)
        if self._failure is None:
            return told
        reason = "out of memory" if isinstance(self._failure, MemoryError) else str(self._failure)
        return (*told, f"The solve ended with an error: {reason}")

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


def _beyond_diffuse(surfaces: Surfaces, is_sampled: bool) -> tuple[str, ...]:
    """What is told of a scene that is not diffuse. Sampled light has come by mirrors too, linked has not."""
    who = "The renderers flat, gouraud and interpolant"
    does, takes = "show surfaces without their specular reflection", "show directional emission as diffuse"
    if not is_sampled:
        who = "The renderers flat, gouraud, interpolant and gather, probes and error estimates"
        does, takes = "leave specular reflection out", "take directional emission as diffuse"
    parts = [does] * surfaces.has_specular + [takes] * surfaces.has_directional_emission
    shown = "the renderer path has all of it, and so has vpl, but for light by many mirrors in a row"
    return (f"{who} {' and '.join(parts)}; {shown}.",) if parts else ()


def _sampled_warning(patches: int) -> str:
    return (
        f"The scene has {patches:,} patches, more than the {MOST_LINKED:,} that can be linked: its light is "
        "sampled by path tracing, which is noisier and starts over at each edit. The renderer interpolant "
        "draws as gouraud does, and the renderer gather is not there."
    )
