"""Sources as a point sees them: what is visible of each, what is hidden, and by what ([H B.4.10])."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Final

import numpy as np

from solver import tolerances
from solver.engine.overlays.base import FIRST_PAGE, Overlay, Page, Shown, Subject, Work
from solver.engine.overlays.partition import part_source
from solver.engine.overlays.places import NEAR, Address, Place
from solver.engine.overlays.shapes import GREEN, VIOLET, WHITE, Primitives, Shapes
from solver.geometry.surfaces import Surfaces
from solver.illumination.visible_parts import PER_BLOCKER, ROOM, visible_factor
from solver.transport.elements import plane_axes
from solver.types import FloatArray, IntArray, Points

_PARTS: Final = 256
"""Visible pieces for which there is room at first"""

_COLOURS: Final = np.array([GREEN, VIOLET, GREEN])
"""Of lines by their kind: OUTLINE, SHADOW, INSERTED"""


class Sources(StrEnum):
    """Which patches are looked at."""

    EMITTING = "emitting"
    ALL = "all"
    """Whatever shows the point its front"""


@dataclass(frozen=True, eq=False)
class _Seen:
    """A source as a point sees it."""

    patch: int
    factor: float
    """Form factor of what is visible"""
    whole_factor: float
    """Of all that is above the point's horizon"""
    whole: Points
    """(k, 3) metres, convex: what is above the horizon"""
    pieces: list[Points]
    """Each (m, 3) metres, convex: they tile what is visible"""


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
        ids = self._facing(surfaces, place)
        shown = self.page.of(ids)
        sight = _Sight(surfaces, place)
        seen, parted = [], []
        for patch in shown.tolist():
            seen.append(sight.of(patch))
            parted.append(_Parted.of(surfaces, seen[-1]))
            yield
        normal = surfaces.normal[place.patch]
        area = np.array([part.area for part in parted])
        visible_area = np.array([part.visible_area for part in parted])
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(ids),
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
                "form_factor": [part.factor for part in seen],
                "form_factor_unoccluded": [part.whole_factor for part in seen],
                "visible": [[piece.tolist() for piece in part.pieces] for part in seen],
                "hidden": [part.hidden.tolist() for part in parted],
            },
            shapes=_shapes(place, seen, parted),
        )

    def _facing(self, surfaces: Surfaces, place: Place) -> IntArray:
        """Patches whose front the point sees some of, were there nothing else, and that are asked for."""
        margin = NEAR * surfaces.size
        is_corner = np.arange(4) < surfaces.corner_count[:, None]
        offset = surfaces.corners - place.position
        up = np.where(is_corner, offset @ surfaces.normal[place.patch], -np.inf).max(axis=1)
        before = -np.einsum("pa,pa->p", offset[:, 0], surfaces.normal)
        facing = (up > margin) & (before > margin)
        if self.sources is Sources.EMITTING:
            facing &= surfaces.emission.any(axis=1)
        return np.flatnonzero(facing).astype(np.int32)


class _Sight:
    """What a point sees, with the room that clipping needs."""

    def __init__(self, surfaces: Surfaces, place: Place) -> None:
        self._surfaces = surfaces
        self._tolerance = tolerances.SIDE * surfaces.size
        self._x = place.position
        self._normal = surfaces.normal[place.patch]
        # Each face blocks once, from either side.
        self._blockers = np.flatnonzero(surfaces.side == 0).astype(np.int32)
        rows = 2 + PER_BLOCKER * len(self._blockers)
        self._stack = np.empty((rows, ROOM, 3))
        self._stack_count = np.empty(rows, dtype=np.int32)
        self._stack_next = np.empty(rows, dtype=np.int32)
        self._work = np.empty((5, ROOM, 3))
        self._room(_PARTS)

    def _room(self, pieces: int) -> None:
        self._parts = np.empty((pieces, ROOM, 3))
        self._part_count = np.empty(pieces, dtype=np.int32)

    def of(self, patch: int) -> _Seen:
        """A source that has a part above the horizon and shows its front."""
        whole_factor, (whole,) = self._look(patch, 0)
        factor, pieces = self._look(patch, len(self._blockers))
        return _Seen(patch, factor, whole_factor, whole, pieces)

    def _look(self, patch: int, blockers: int) -> tuple[float, list[Points]]:
        """The form factor, and the pieces that are visible past so many of the blockers."""
        s = self._surfaces
        while True:
            factor, found = visible_factor(
                self._x, self._normal, s.corners[patch], s.corner_count[patch], self._blockers, 0, blockers,
                s.corners, s.corner_count, s.normal, self._tolerance, self._stack, self._stack_count,
                self._stack_next, self._work, self._parts, self._part_count,
            )  # fmt: skip
            if found <= len(self._parts):
                pieces = [self._parts[k, : self._part_count[k]] + self._x for k in range(found)]
                return float(factor), pieces
            self._room(found)


@dataclass(frozen=True, eq=False)
class _Parted:
    """A source in parts, in metres."""

    area: float
    visible_area: float
    hidden: FloatArray
    """(h, 3, 3) triangles"""
    lines: FloatArray
    """(l, 2, 3)"""
    kind: IntArray
    """(l,) as in `Partition`"""

    @staticmethod
    def of(surfaces: Surfaces, seen: _Seen) -> _Parted:
        """The parts of what is above the horizon."""
        origin = seen.whole[0]
        axes = plane_axes(surfaces.normal[[seen.patch]])[0]
        size = float(np.linalg.norm(seen.whole - origin, axis=1).max())
        whole, *pieces = (((p - origin) @ axes.T) / size for p in (seen.whole, *seen.pieces))
        parts = part_source(whole, pieces)
        back = size * axes
        return _Parted(
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


def _shapes(place: Place, seen: list[_Seen], parted: list[_Parted]) -> Shapes:
    """Visible parts white, hidden ones transparent; blockers' edges violet, other lines green."""
    fans = [piece[[0, k, k + 1]] for part in seen for piece in part.pieces for k in range(1, len(piece) - 1)]
    lines = np.concatenate([part.lines for part in parted] or [np.empty((0, 2, 3))])
    kind = np.concatenate([part.kind for part in parted] or [np.empty(0, dtype=np.int32)])
    return Shapes(
        points=Primitives.of(place.position[None, None], WHITE),
        lines=Primitives.of(lines, _COLOURS[kind]),
        triangles=Primitives.of(np.array(fans).reshape(-1, 3, 3), WHITE),
    )
