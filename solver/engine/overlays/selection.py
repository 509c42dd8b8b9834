"""Which triangles are meant: those of an element, one alone, or all ([H B.4.6])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.engine.overlays.base import Subject, index_of
from solver.engine.overlays.elements import within
from solver.errors import SceneError
from solver.types import IntArray


@dataclass(frozen=True)
class Selection:
    """At most one of the two is given."""

    triangle: int | None = None
    """Of the triangulation"""
    element: int | None = None
    """All triangles on this element and its parts"""

    @property
    def is_given(self) -> bool:
        """Whether anything in particular is meant."""
        return self.triangle is not None or self.element is not None

    def triangles(self, subject: Subject) -> IntArray:
        """The triangles (m,), ascending. Raises SceneError naming what does not exist, NotReadyError."""
        mesh = subject.interpolants().triangulation
        count = len(mesh.triangles)
        if self.triangle is not None:
            if self.element is not None:
                raise SceneError("give either a triangle or an element", ("triangle",))
            return np.array([index_of(self.triangle, count, "triangle", "triangles")], dtype=np.int32)
        if self.element is None:
            return np.arange(count, dtype=np.int32)
        tree = subject.solution.solver.state.tree
        index_of(self.element, len(tree), "element", "elements")
        chosen = within(tree, self.element)[tree.leaves]
        return np.flatnonzero(chosen[mesh.leaf]).astype(np.int32)

    def is_built(self, subject: Subject) -> bool:
        """Whether all samples of the triangles are exact, which is seen to from now on. Raises as above."""
        triangles, interpolants = self.triangles(subject), subject.interpolants()
        built = bool(interpolants.is_fine[triangles].all())
        if not built and subject.fine is not None:
            subject.fine.build(triangles)
        return built


EVERYTHING: Final = Selection()
