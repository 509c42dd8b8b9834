"""Interpolants of the last solution that rested, which frames show until those of the next are there."""

from __future__ import annotations

from typing import Final

from solver.engine.fine import FineLight
from solver.engine.solution import Solution
from solver.errors import SolverError
from solver.illumination.interpolation.following import Following
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.transport.solve import RadiositySolver

_MOST: Final = 60_000
"""Triangles: of more, it takes longer to follow than to draw the elements"""


class FollowedLight:
    """Interpolants that follow the solutions of one edit after another."""

    def __init__(self, following: Following) -> None:
        """Nothing is followed yet."""
        self._following = following
        self._shown: tuple[Solution, int, InterpolantMesh | None] | None = None

    def mesh(self, solution: Solution) -> InterpolantMesh | None:
        """The interpolants in the light of `solution` as it stands; None where they cannot be followed."""
        shown = self._shown
        if shown is None or shown[0] is not solution or shown[1] != solution.version:
            # What has arrived is taken in by whoever asks for the field.
            solution.field()
            self._shown = shown = solution, solution.version, self._mesh_of(solution)
        return shown[2]

    def _mesh_of(self, solution: Solution) -> InterpolantMesh | None:
        trace, solver = solution.trace(), solution.solver
        if trace is None or not isinstance(solver, RadiositySolver):
            return None
        try:
            return self._following.mesh(solver.state, trace.patch, trace.at_elements(solver.state.tree))
        except (SolverError, ValueError):
            # The elements are shown, of which nothing needs to be triangulated.
            return None


def follow(fine: FineLight) -> FollowedLight | None:
    """Let interpolants follow, before an edit takes over their solution; None where there are none."""
    interpolants, solver = fine.interpolants, fine.solution.solver
    if interpolants is None or not isinstance(solver, RadiositySolver):
        return None
    if len(interpolants.triangulation.triangles) > _MOST:
        return None
    return FollowedLight(Following(interpolants, solver.state))
