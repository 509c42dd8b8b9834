"""Irradiance as a surface over triangles: exact, interpolated, and the difference ([H B.4.7])."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Final, NamedTuple

import numpy as np

from solver.engine.overlays.base import FIRST_PAGE, Needs, Overlay, Page, Shown, Subject, Work, to_rgb
from solver.engine.overlays.heights import height_scale, lifted
from solver.engine.overlays.selection import EVERYTHING, Selection
from solver.engine.overlays.shapes import BLUE, RED, WHITE, Primitives, Shapes
from solver.errors import LimitExceededError, SceneError
from solver.illumination.interpolation.evaluate import evaluate_interpolants
from solver.illumination.interpolation.samples import NUDGE
from solver.transport.pace import Pace
from solver.types import LUMINANCE_WEIGHTS, FloatArray, IntArray, Points, Spectra

DENSEST: Final = 32
"""Steps along the sides of a triangle as large as its patch, where the density is left to the overlay."""

MAX_RESOLUTION: Final = 256
"""Steps that may be asked for."""


_COST: Final = 16
"""Of a point irradiance, as batches count costs"""

MAX_POINTS: Final = 1_000_000
"""Points of all grids together, shown or not"""


class GraphKind(StrEnum):
    """What the height of a graph is."""

    ANALYTIC = "analytic"
    """Point irradiance"""
    INTERPOLATED = "interpolated"
    DIFFERENCE = "difference"
    """Analytic less interpolated"""


_COLOURS: Final = {
    GraphKind.ANALYTIC: WHITE,
    GraphKind.INTERPOLATED: BLUE,
    GraphKind.DIFFERENCE: RED,
}


@dataclass(frozen=True)
class GraphOverlay(Overlay):
    """A grid of points over each triangle of a selection."""

    name: ClassVar[str] = "graph"
    needs: ClassVar[Needs] = Needs.TRIANGLES
    selection: Selection = EVERYTHING
    kind: GraphKind = GraphKind.ANALYTIC
    resolution: int | None = None
    """Steps along the sides of each triangle; None: the more, the larger its share of its patch"""
    scale: float | None = None
    """Metres for a W/m2; None: as suits"""
    page: Page = FIRST_PAGE

    def show(self, subject: Subject) -> Work:
        """One item a point. Raises SceneError naming a parameter, NotReadyError."""
        yield
        interpolants, surfaces = subject.interpolants(), subject.world.surfaces
        mesh = interpolants.triangulation
        triangles = self._triangles(subject)
        steps = self._steps(interpolants.area[triangles], surfaces.area[mesh.patch[triangles]])
        grids = _Grids.over(steps)
        shown = slice(self.page.offset, self.page.offset + self.page.limit)
        owner = triangles[grids.owner[shown]]
        st = grids.st[shown]
        corners = mesh.position[mesh.triangles[owner]]
        position = _at(corners, st)
        value = yield from self._values(subject, owner, st, corners)
        luminance = value @ LUMINANCE_WEIGHTS
        patch = mesh.patch[owner]
        scale = height_scale(subject, triangles, self.scale)
        height = scale * luminance
        lines = grids.lines(self.page)
        top = lifted(subject, position, patch, height)
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(grids.owner),
            facts={
                "objects": surfaces.object_ids,
                "kind": self.kind.value,
                "height_scale": scale,
                "triangles": triangles,
                "resolution": steps,
                "lines": lines,
            },
            columns={
                "triangle": owner,
                "st": st,
                "position": position,
                "irradiance": value,
                "luminance": luminance,
                "height": height,
            },
            shapes=Shapes(lines=Primitives.of(top[lines], _COLOURS[self.kind])),
        )

    def is_built(self, subject: Subject) -> bool:
        """Interpolants that are shown are built first."""
        self._triangles(subject)
        return self.kind is GraphKind.ANALYTIC or self.selection.is_built(subject)

    def _triangles(self, subject: Subject) -> IntArray:
        if not self.selection.is_given:
            raise SceneError("a graph is over a triangle or an element: give one", ("triangle",))
        return self.selection.triangles(subject)

    def _steps(self, area: FloatArray, of_patch: FloatArray) -> IntArray:
        """(m,) steps along the sides of triangles, so that all of a patch's have about as many points."""
        if self.resolution is not None:
            return np.full(len(area), self.resolution, dtype=np.int32)
        return np.asarray(np.ceil(DENSEST * np.sqrt(area / of_patch)).clip(1, DENSEST).astype(np.int32))

    def _values(
        self, subject: Subject, triangle: IntArray, st: FloatArray, corners: FloatArray
    ) -> Generator[None, None, Spectra]:
        """(n, 3) W/m2 at points of triangles (n,)."""
        interpolants = subject.interpolants()
        # The limit from inside of the triangle, as its samples are taken.
        inside = st + NUDGE * (1.0 / 3.0 - st)
        interpolated = evaluate_interpolants(interpolants.mesh(), triangle, st)
        if self.kind is GraphKind.INTERPOLATED:
            return interpolated
        point, tree = subject.point_irradiance(), subject.solution.solver.state.tree
        elements = tree.leaves[interpolants.triangulation.leaf[triangle]]
        places = _at(corners, inside)
        exact = np.empty((len(triangle), 3))
        for part in Pace().batches(np.full(len(triangle), _COST, dtype=np.int64)):
            exact[part] = to_rgb(point.at(places[part], elements[part]))
            yield
        return exact if self.kind is GraphKind.ANALYTIC else exact - interpolated


def _at(corners: FloatArray, st: FloatArray) -> Points:
    """(n, 3) points at s, t of triangles (n, 3, 3)."""
    weights = np.concatenate([1.0 - st.sum(axis=1, keepdims=True), st], axis=1)
    return np.asarray(np.einsum("nk,nka->na", weights, corners))


class _Grids(NamedTuple):
    """Triangular grids over m triangles, one after the other."""

    owner: IntArray
    """(n,) which of the triangles each point is on"""
    st: FloatArray
    """(n, 2)"""
    edges: IntArray
    """(l, 2) points that are joined"""

    @staticmethod
    def over(steps: IntArray) -> _Grids:
        """Grids with so many steps (m,) along each side. Raises LimitExceededError."""
        last = np.cumsum((steps + 1) * (steps + 2) // 2, dtype=np.int64)
        if last[-1] > MAX_POINTS:
            raise LimitExceededError("points of the graph", int(last[-1]), MAX_POINTS)
        first = np.concatenate([[0], last[:-1]])
        owner, st, edges = [], [], []
        # Grids of one density are made at once.
        for n in np.unique(steps).tolist():
            chosen = np.flatnonzero(steps == n)
            points, joined = _grid(n)
            owner.append(np.repeat(chosen, len(points)))
            st.append(np.tile(points, (len(chosen), 1)))
            edges.append((first[chosen][:, None, None] + joined).reshape(-1, 2))
        order = np.argsort(np.concatenate(owner), kind="stable")
        return _Grids(
            np.concatenate(owner)[order].astype(np.int32),
            np.concatenate(st)[order],
            np.concatenate(edges).astype(np.int32),
        )

    def lines(self, page: Page) -> IntArray:
        """(l, 2) lines between points that are both on the page, by their places on it."""
        inside = (self.edges >= page.offset) & (self.edges < page.offset + page.limit)
        return self.edges[inside.all(axis=1)] - np.int32(page.offset)


def _grid(n: int) -> tuple[FloatArray, IntArray]:
    """Points (k, 2) s, t of a grid with n steps along each side, and the pairs (l, 2) of neighbours."""
    i, j = np.nonzero(np.add.outer(np.arange(n + 1), np.arange(n + 1)) <= n)
    number = np.full((n + 2, n + 2), -1)
    number[i, j] = np.arange(len(i))
    joined = [np.stack([number[i, j], number[i + a, j + b]], axis=1) for a, b in ((1, 0), (0, 1))]
    falling = j > 0
    joined.append(np.stack([number[i, j], number[i + 1, j - 1]], axis=1)[falling])
    edges = np.concatenate(joined)
    return np.stack([i, j], axis=1) / n, edges[edges[:, 1] >= 0].astype(np.int32)
