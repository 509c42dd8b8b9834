"""A scene with the structures that geometry alone decides: patches for light, triangles for rays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.geometry.scene import Scene
from solver.geometry.surfaces import Surfaces, flatten
from solver.types import LUMINANCE_WEIGHTS, ObjectId
from solver.visibility.rays import RayScene


@dataclass(frozen=True, eq=False)
class World:
    """One revision of a scene, ready to be lit and looked at."""

    scene: Scene
    surfaces: Surfaces
    rays: RayScene

    @staticmethod
    def of(scene: Scene, before: World | None = None, in_colour: bool = False) -> World:
        """The world of `scene`; the ray hierarchy of the world `before` is kept where no triangle moved.

        A scene without colours is lit in one channel, unless it is to be lit `in_colour`.
        """
        surfaces = replace(flatten(scene), in_colour=in_colour) if in_colour else flatten(scene)
        if before is not None and _same_triangles(surfaces, before.surfaces):
            return World(scene, surfaces, before.rays)
        return World(scene, surfaces, RayScene(surfaces.triangles, surfaces.center, surfaces.size))

    def emission_by_object(self) -> dict[ObjectId, float]:
        """W of luminance that the surfaces of each object emit."""
        surfaces = self.surfaces
        emitted = surfaces.area * (surfaces.emission @ LUMINANCE_WEIGHTS)
        total = np.bincount(surfaces.object, emitted, len(surfaces.object_ids))
        return dict(zip(surfaces.object_ids, total.tolist(), strict=True))


def _same_triangles(a: Surfaces, b: Surfaces) -> bool:
    return (
        a.size == b.size and np.array_equal(a.center, b.center) and np.array_equal(a.triangles, b.triangles)
    )
