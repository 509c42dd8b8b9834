"""The triangulation that interpolants are based on ([H B.4.5])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from solver.engine.overlays.base import FIRST_PAGE, Needs, Overlay, Page, Shown, Subject, Work, or_none
from solver.engine.overlays.selection import EVERYTHING, Selection
from solver.engine.overlays.shapes import GREEN, VIOLET, Primitives, Shapes
from solver.illumination.meshing.triangulation import Triangulation
from solver.types import IntArray


@dataclass(frozen=True)
class TriangulationOverlay(Overlay):
    """Triangles, and which of their edges lie along discontinuities."""

    name: ClassVar[str] = "triangulation"
    needs: ClassVar[Needs] = Needs.TRIANGLES
    selection: Selection = EVERYTHING
    page: Page = FIRST_PAGE

    def show(self, subject: Subject) -> Work:
        """One item a triangle. Raises SceneError naming `triangle` or `element`, NotReadyError."""
        yield
        interpolants, surfaces = subject.interpolants(), subject.world.surfaces
        mesh = interpolants.triangulation
        ids = self.selection.triangles(subject)
        shown = self.page.of(ids)
        patch = mesh.patch[shown]
        corners = mesh.position[mesh.triangles[shown]]
        on_line = mesh.edge_set[shown] >= 0
        triangle, k = _edges_once(mesh, shown)
        ends = np.stack([mesh.triangles[triangle, k], mesh.triangles[triangle, (k + 1) % 3]], axis=1)
        colour = np.where((mesh.edge_set[triangle, k] >= 0)[:, None], VIOLET, GREEN)
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(ids),
            facts={"objects": surfaces.object_ids, "edges": len(ends)},
            columns={
                "triangle": shown,
                "element": subject.solution.solver.state.tree.leaves[mesh.leaf[shown]],
                "cell": mesh.cell[shown],
                "patch": patch,
                "object": surfaces.object[patch],
                "face": surfaces.face[patch],
                "vertices": mesh.triangles[shown],
                "corners": corners,
                "area": interpolants.area[shown],
                "edge_is_discontinuity": on_line,
                "edge_is_jump": mesh.edge_jump[shown],
                "edge_set": or_none(mesh.edge_set[shown]),
                "neighbour": or_none(mesh.neighbour[shown]),
                "exact": interpolants.is_fine[shown],
                "error": interpolants.errors()[shown],
            },
            shapes=Shapes(lines=Primitives.of(mesh.position[ends], colour)),
        )


def _edges_once(mesh: Triangulation, shown: IntArray) -> tuple[IntArray, IntArray]:
    """Triangle (e,) and number (e,) of every edge of the triangles `shown`, those that two share once."""
    there = np.zeros(len(mesh.triangles), dtype=np.bool_)
    there[shown] = True
    other = mesh.neighbour[shown]
    first = (other < 0) | ~there[other] | (shown[:, None] < other)
    row, k = np.nonzero(first)
    return shown[row], k.astype(np.int32)
