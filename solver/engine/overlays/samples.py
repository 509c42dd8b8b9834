"""Where interpolants are sampled, and what was found there ([H B.4.8])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from solver.engine.overlays.base import FIRST_PAGE, Needs, Overlay, Page, Shown, Subject, Work, to_rgb
from solver.engine.overlays.heights import height_scale, lifted
from solver.engine.overlays.selection import EVERYTHING, Selection
from solver.engine.overlays.shapes import YELLOW, Primitives, Shapes
from solver.types import LUMINANCE_WEIGHTS


@dataclass(frozen=True)
class SamplesOverlay(Overlay):
    """The samples of a triangle, of an element, or all."""

    name: ClassVar[str] = "samples"
    needs: ClassVar[Needs] = Needs.TRIANGLES
    selection: Selection = EVERYTHING
    scale: float | None = None
    """Metres for a W/m2; None: as suits"""
    page: Page = FIRST_PAGE

    def show(self, subject: Subject) -> Work:
        """One item a sample. Raises SceneError naming `triangle` or `element`, NotReadyError."""
        yield
        interpolants, surfaces = subject.interpolants(), subject.world.surfaces
        mesh = interpolants.triangulation
        triangles = self.selection.triangles(subject)
        # A sample that several triangles share is shown once, with the first of them.
        ids, first = np.unique(interpolants.nodes[triangles], return_index=True)
        if self.selection.triangle is not None:
            order = np.argsort(first)
            ids, first = ids[order], first[order]
        shown, owner = self.page.of(ids), triangles[self.page.of(first.astype(np.int32)) // 6]
        positions, values, exact = interpolants.sample_points()
        position, value = positions[shown], to_rgb(values[shown])
        luminance = value @ LUMINANCE_WEIGHTS
        patch = mesh.patch[owner]
        scale = height_scale(subject, triangles, self.scale)
        top = lifted(subject, position, patch, scale * luminance)
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(ids),
            facts={"objects": surfaces.object_ids, "height_scale": scale},
            columns={
                "sample": shown,
                "triangle": owner,
                "element": subject.solution.solver.state.tree.leaves[mesh.leaf[owner]],
                "patch": patch,
                "object": surfaces.object[patch],
                "position": position,
                "irradiance": value,
                "luminance": luminance,
                "height": scale * luminance,
                "exact": exact[shown],
            },
            shapes=Shapes(
                points=Primitives.of(top[:, None], YELLOW),
                lines=Primitives.of(np.stack([position, top], axis=1), YELLOW),
            ),
        )

    def is_built(self, subject: Subject) -> bool:
        """What is selected is built first; of all, what is not exact yet says so."""
        return not self.selection.is_given or self.selection.is_built(subject)
