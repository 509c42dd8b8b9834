"""What a session has been spared, and what that may cost in accuracy ("model only what a scene needs")."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from solver.engine.fine import FineLight
from solver.engine.solution import Solution
from solver.engine.status import FineStatistics, Spared
from solver.transport.oracle import MAX_SAMPLES
from solver.transport.settings import Saving
from solver.transport.solve import RadiositySolver
from solver.visibility.pair_rays import STRATA

COARSE_LINKS: Final = "coarse_links"
"""Links that bring light and are not subdivided further; `error_tolerance` is what turns this."""


def savings_of(solution: Solution, fine: FineLight | None) -> tuple[Spared, ...]:
    """The savings of a solution so far, and of what was built on it; none of a sampled one.

    Channels and shadow tests are left out where that makes no difference. What coarse links and few rays cost
    is part of the solution's error estimate, and what discontinuities cost of that of interpolants.
    """
    solver = solution.solver
    if not isinstance(solver, RadiositySolver):
        return ()
    return (*_of_solve(solver), *_of_fine(fine))


def _of_solve(solver: RadiositySolver) -> Iterator[Spared]:
    counts, parts = solver.statistics(), solver.error_parts
    in_full = solver.settings.in_full
    yield Spared(Saving.CHANNELS, 3 - counts.channels, 3, 0.0)
    untested = 0 if Saving.SHADOW_TESTS in in_full else counts.links - counts.links_partial
    yield Spared(Saving.SHADOW_TESTS, untested, counts.links, 0.0)
    most = STRATA * MAX_SAMPLES * counts.links_partial
    samples = solver.state.links.samples
    yield Spared(Saving.RAYS, most - min(most, STRATA * int(samples.sum())), most, parts.noise)
    yield Spared(COARSE_LINKS, counts.links - counts.links_none, counts.links, parts.coarseness)


def _of_fine(fine: FineLight | None) -> Iterator[Spared]:
    told = FineStatistics() if fine is None else fine.statistics()
    left_out = told.discontinuities_weak + told.discontinuities_crowded
    lines = None if fine is None else fine.lines
    error = 0.0 if lines is None else lines.left_out
    yield Spared(Saving.DISCONTINUITIES, left_out, told.discontinuities, error)
    yield Spared(Saving.INTERPOLANTS, told.triangles - told.interpolants, told.triangles, 0.0)
