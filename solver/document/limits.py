"""How large a scene may be, counted on the document before any geometry is built."""

from __future__ import annotations

from dataclasses import dataclass

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
        polygons = sum(len(o.mesh.faces) for o in scene)
        vertices = sum(max(len(o.mesh.vertices), sum(map(len, o.mesh.faces))) for o in scene)
        if polygons > self.max_polygons:
            raise LimitExceededError("polygons", polygons, self.max_polygons)
        if vertices > self.max_vertices:
            raise LimitExceededError("vertices", vertices, self.max_vertices)
