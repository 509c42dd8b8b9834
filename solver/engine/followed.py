"""Interpolants of the last solution that rested, which frames show until those of the next are there."""

from __future__ import annotations

from typing import Final

from solver.engine.drawing import Drawing
from solver.engine.fine import FineLight
from solver.engine.solution import Solution
from solver.illumination.interpolation.following import Following
from solver.illumination.interpolation.interpolants import Interpolants
from solver.illumination.interpolation.mesh import InterpolantMesh
from solver.rendering.joining import join
from solver.transport.solve import RadiositySolver

_MOST: Final = 60_000
"""Triangles: of more, it takes longer to follow than to draw the elements"""


class FollowedLight:
    """Interpolants that follow the solutions of one edit after another."""

    def __init__(self, following: Following) -> None:
        """Nothing is followed yet."""
        self._following = following
        self._shown: tuple[Solution, int, InterpolantMesh | None] | None = None

    @property
    def interpolants(self) -> Interpolants:
        """As they were when they were left."""
        return self._following.interpolants

    def mesh(self, solution: Solution, drawing: Drawing) -> InterpolantMesh | None:
        """What to draw of `solution` as it stands; None where its elements alone are to be drawn."""
        shown = self._shown
        if shown is None or shown[0] is not solution or shown[1] != solution.version:
            self._shown = shown = solution, solution.version, self._mesh_of(solution, drawing)
        return shown[2]

    def _mesh_of(self, solution: Solution, drawing: Drawing) -> InterpolantMesh | None:
        trace, solver, before = solution.trace(), solution.solver, self.interpolants.triangulation
        if trace is None or not isinstance(solver, RadiositySolver) or len(before.triangles) > _MOST:
            return None
        # What has arrived is taken in by whoever asks for the field.
        elements = drawing.mesh_of(solution.world, solution.field())
        tree = solver.state.tree
        found = self._following.follow(solver.state, trace.patch, trace.at_elements(tree))
        return join(
            before.position, before.triangles[found.triangles], found.coefficients, found.patch, elements,
            found.by_elements[tree.leaves],
        )  # fmt: skip


def follow(fine: FineLight) -> FollowedLight | None:
    """Let interpolants follow, before an edit takes over their solution; None where there are none."""
    following = fine.following()
    return None if following is None else FollowedLight(following)
