"""Sources as a point sees them: what is visible of each, what is hidden, and by what ([H B.4.10])."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Final

import numpy as np

from solver.engine.overlays.base import FIRST_PAGE, Overlay, Page, Shown, Subject, Work
from solver.engine.overlays.partition import part_source
from solver.engine.overlays.places import Address, Place
from solver.engine.overlays.shapes import GREEN, VIOLET, WHITE, Primitives, Shapes
from solver.geometry.surfaces import Surfaces
from solver.illumination.points.backprojection import Backprojection, backproject
from solver.transport.elements import plane_axes
from solver.types import FloatArray, IntArray, Points
from solver.visibility.bvh import build_hierarchy

_COLOURS: Final = np.array([GREEN, VIOLET, GREEN])
"""Of lines by their kind: OUTLINE, SHADOW, INSERTED"""


class Sources(StrEnum):
    """Which patches are looked at."""

    EMITTING = "emitting"
    ALL = "all"
    """Whatever shows the point its front above its horizon"""


@dataclass(frozen=True)
class BackprojectionOverlay(Overlay):
    """The backprojection of one point on to its sources."""

    at: Address
    name: ClassVar[str] = "backprojection"
    sources: Sources = Sources.EMITTING
    page: Page = FIRST_PAGE

    def show(self, subject: Subject) -> Work:
        """One item a source. Raises SceneError naming a parameter, RenderingUnavailableError."""
        yield
        surfaces = subject.world.surfaces
        place = self.at.find(subject)
        hierarchy = build_hierarchy(surfaces.corners, np.flatnonzero(surfaces.side == 0).astype(np.int32))
        yield
        found = backproject(
            surfaces, hierarchy, place.position, surfaces.normal[place.patch], self._asked(surfaces)
        )
        chosen = self.page.of(np.arange(len(found), dtype=np.int32))
        shown = found.patch[chosen]
        yield
        parted = []
        for k in chosen.tolist():
            parted.append(_Parted.of(surfaces, found, k))
            yield
        normal = surfaces.normal[place.patch]
        area = np.array([part.area for part in parted])
        visible_area = np.array([part.visible_area for part in parted])
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(found),
            facts={
                "objects": surfaces.object_ids,
                "position": place.position.tolist(),
                "normal": (normal + 0.0).tolist(),
                "receiver": place.patch,
                "element": place.element,
                "sources": self.sources.value,
            },
            columns={
                "patch": shown,
                "object": surfaces.object[shown],
                "face": surfaces.face[shown],
                "corners": surfaces.corners[shown],
                "corner_count": surfaces.corner_count[shown],
                "emits": np.asarray(surfaces.emission[shown].any(axis=1)),
                "area_above_horizon": area,
                "visible_fraction": visible_area / area,
                "form_factor": found.visible_factor[chosen],
                "form_factor_unoccluded": found.factor[chosen],
                "visible": [[piece.tolist() for piece in part.visible] for part in parted],
                "hidden": [part.hidden.tolist() for part in parted],
            },
            shapes=_shapes(place, parted),
        )

    def _asked(self, surfaces: Surfaces) -> IntArray:
        emits = surfaces.emission.any(axis=1)
        return np.flatnonzero(emits | (self.sources is Sources.ALL)).astype(np.int32)


@dataclass(frozen=True, eq=False)
class _Parted:
    """A source in parts, in metres."""

    visible: list[Points]
    """Each (m, 3), convex: they tile what is seen"""
    area: float
    visible_area: float
    hidden: FloatArray
    """(h, 3, 3) triangles"""
    lines: FloatArray
    """(l, 2, 3)"""
    kind: IntArray
    """(l,) as in `Partition`"""

    @staticmethod
    def of(surfaces: Surfaces, seen: Backprojection, k: int) -> _Parted:
        """The parts of what of source k is above the horizon."""
        above, visible = seen.source(k), seen.visible(k)
        origin = above[0]
        axes = plane_axes(surfaces.normal[seen.patch[k : k + 1]])[0]
        size = float(np.linalg.norm(above - origin, axis=1).max())
        whole, *pieces = (((p - origin) @ axes.T) / size for p in (above, *visible))
        parts = part_source(whole, pieces)
        back = size * axes
        return _Parted(
            visible=visible,
            area=size**2 * _area(whole),
            visible_area=size**2 * sum(map(_area, pieces)),
            hidden=origin + parts.hidden @ back,
            lines=origin + parts.lines @ back,
            kind=parts.kind,
        )


def _area(polygon: FloatArray) -> float:
    """Of a polygon (k, 2) that runs counter-clockwise."""
    x, y = (polygon - polygon[0]).T
    return 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def _shapes(place: Place, parted: list[_Parted]) -> Shapes:
    """Visible parts white, hidden ones transparent; blockers' edges violet, other lines green."""
    fans = [
        piece[[0, k, k + 1]] for part in parted for piece in part.visible for k in range(1, len(piece) - 1)
    ]
    lines = np.concatenate([part.lines for part in parted] or [np.empty((0, 2, 3))])
    kind = np.concatenate([part.kind for part in parted] or [np.empty(0, dtype=np.int32)])
    return Shapes(
        points=Primitives.of(place.position[None, None], WHITE),
        lines=Primitives.of(lines, _COLOURS[kind]),
        triangles=Primitives.of(np.array(fans).reshape(-1, 3, 3), WHITE),
    )
