"""How large a scene may be, counted on the document before any geometry is built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from solver.document.models import SceneDocument
from solver.errors import LimitExceededError
from solver.geometry.scene import Scene


@dataclass(frozen=True)
class SceneLimits:
    """Largest scene that is accepted."""

    max_polygons: int = 100_000
    """Faces over all objects"""
    max_vertices: int = 1_000_000
    """Vertices over all objects; corners of faces count as vertices where they are more"""

    def check(self, scene: Scene) -> None:
        """Raise LimitExceededError where `scene` is larger."""
        self._check([(len(o.mesh.vertices), o.mesh.faces) for o in scene])

    def check_document(self, document: SceneDocument) -> None:
        """Raise LimitExceededError where `document` is larger, before anything is computed from it."""
        self._check([(len(o.mesh.vertices), o.mesh.faces) for o in document.objects])

    def _check(self, meshes: Sequence[tuple[int, Sequence[Sequence[int]]]]) -> None:
        polygons = sum(len(faces) for _, faces in meshes)
        vertices = sum(max(count, sum(map(len, faces))) for count, faces in meshes)
        if polygons > self.max_polygons:
            raise LimitExceededError("polygons", polygons, self.max_polygons)
        if vertices > self.max_vertices:
            raise LimitExceededError("vertices", vertices, self.max_vertices)
