"""Irradiance at points, from a radiosity solution: the exact yardstick of everything else ([H 6]).

Every emitting patch counts whole, with its exact visible part. Reflected light comes over the links of the
leaf on which a point lies, from elements as fine as their radiosity varies; for points off the surfaces,
from all patches.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.obstacles import Obstacles, find_obstacles
from solver.geometry.surfaces import Surfaces
from solver.illumination.points.desk import Elements, Light
from solver.illumination.points.gather_anywhere import gather_anywhere
from solver.illumination.points.gather_over_links import Table, gather_over_links
from solver.illumination.points.light import Lamps, LinksByElement, Sources
from solver.parallel import run_chunks
from solver.transport.elements import ElementTree
from solver.transport.links import LinkTable
from solver.transport.pace import finish
from solver.transport.places import functions_at, leaves_at
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray, Points, Spectra
from solver.visibility.bvh import Hierarchy

DEFAULT_ACCURACY: Final = 1e-3
"""Share of the irradiance that one source may err by."""

ON_PLANE: Final = 1e-12
"""A point is on a blocker's plane within this times the scene's size: rounding alone."""

ON_SURFACE: Final = 1e-7
"""The same for points that a client gives, with fewer digits."""

_DARKNESS: Final = 1e-2
"""Where there is less light than this share of the scene's mean irradiance, it need not be more accurate."""

FEW_PATCHES: Final = 256
"""With so many patches or fewer it is sooner done to ask all of them than to follow links."""

_CHUNK: Final = 64
_MANY: Final = 1 << 14


@dataclass(frozen=True, eq=False)
class PointIrradiance:
    """What a solution brings to points; the solution must not be worked on meanwhile."""

    surfaces: Surfaces
    hierarchy: Hierarchy
    obstacles: Obstacles
    accuracy: float
    tree: ElementTree
    links: LinkTable
    by_element: LinksByElement | None
    """None where all patches are asked"""
    lamps: Lamps | None
    light: Sources
    """all that leaves the elements"""
    reflected: Sources
    """what of it is reflected"""
    received: FloatArray
    """(n, 3, channels) the solution's own irradiance functions"""
    emission: Spectra
    """(p, channels)"""
    weights: FloatArray
    """(channels,) of luminance"""
    darkness: float
    """W/m2 of luminance irradiance below which the error does not shrink with the light"""

    @staticmethod
    def of(
        state: TransportState,
        hierarchy: Hierarchy,
        accuracy: float = DEFAULT_ACCURACY,
        few: int = FEW_PATCHES,
    ) -> PointIrradiance:
        """Of the light in `state`; `hierarchy` holds the patches that block.

        `accuracy`: share of a point's irradiance that the treatment of one source may err by, and those
        together that count with the visibility of their link. Elements are entered until their nonlinear
        rest brings less. Scenes of `few` patches or fewer do without links.
        """
        return finish(PointIrradiance.in_steps(state, hierarchy, accuracy, few))

    @staticmethod
    def in_steps(
        state: TransportState,
        hierarchy: Hierarchy,
        accuracy: float = DEFAULT_ACCURACY,
        few: int = FEW_PATCHES,
    ) -> Generator[None, None, PointIrradiance]:
        """As `of`; yields every few milliseconds."""
        tree = state.tree
        by_element = lamps = None
        if tree.patch_count > few:
            by_element = LinksByElement.of(state.links, len(tree))
            yield
            lamps = yield from Lamps.of(
                state.surfaces, hierarchy, tree.corners, tree.corner_count, tree.patch, tree.leaves
            )
        light = Sources.of(state, reflected_only=False)
        yield
        return PointIrradiance(
            surfaces=state.surfaces,
            hierarchy=hierarchy,
            obstacles=find_obstacles(state.surfaces),
            accuracy=accuracy,
            tree=tree,
            links=state.links,
            by_element=by_element,
            lamps=lamps,
            light=light,
            reflected=Sources.of(state, reflected_only=True),
            received=state.received,
            emission=state.emission,
            weights=state.weights,
            darkness=_darkness(state),
        )

    def of_light(self, state: TransportState) -> PointIrradiance:
        """That of `state`, which has the same tree and links, and other light."""
        return replace(
            self,
            light=Sources.of(state, reflected_only=False),
            reflected=Sources.of(state, reflected_only=True),
            received=state.received,
            darkness=_darkness(state),
        )

    def of_reflected(self) -> PointIrradiance:
        """That of the reflected light alone."""
        return replace(self, light=self.reflected, emission=np.zeros_like(self.emission))

    def at(self, positions: Points, elements: IntArray) -> Spectra:
        """Irradiance (n, channels) in W/m2 at positions (n, 3) on leaf `elements` (n,).

        A point on an edge of a blocker should lie a little to the side from which it is meant [H 6.3].
        """
        normals = self.surfaces.normal[self.tree.patch[elements]]
        if self.by_element is None or self.lamps is None:
            return self.anywhere(positions, normals)
        return self._over_links(self.by_element, self.lamps, positions, normals, elements)

    def anywhere(self, positions: Points, normals: FloatArray) -> Spectra:
        """Irradiance (n, channels) in W/m2 at points (n, 3) with unit normals (n, 3), on surfaces or off.

        All patches are asked.
        """
        h, size = self.hierarchy, self.surfaces.size
        elements, light = self._elements(), _light(self.light)
        shines = np.asarray(self.emission.any(axis=1))
        out = np.empty((len(positions), self.emission.shape[1]))

        def work(start: int, stop: int) -> None:
            gather_anywhere(
                positions, normals, self.accuracy, h.low, h.high, h.skip, h.first, h.count, h.order, elements,
                light, shines, tolerances.SIDE * size, ON_SURFACE * size, ON_PLANE * size, start, stop, out,
            )  # fmt: skip

        run_chunks(work, len(positions), _CHUNK, 1)
        return out

    def _over_links(
        self,
        by_element: LinksByElement,
        lamps: Lamps,
        positions: Points,
        normals: FloatArray,
        leaves: IntArray,
    ) -> Spectra:
        links = self.links
        elements, light = self._elements(), _light(self.reflected)
        over = Table(
            by_element.first, by_element.other, by_element.link, links.kind, links.visibility,
            links.blocker_start, links.blocker_count, links.pool,
        )  # fmt: skip
        lit = Table(
            lamps.first, lamps.patch, np.arange(len(lamps.patch), dtype=np.int32), lamps.kind, np.empty(0),
            lamps.blocker_start, lamps.blocker_count, lamps.pool,
        )  # fmt: skip
        most = max(int(links.blocker_count.max(initial=0)), int(lamps.blocker_count.max(initial=0)))
        expected = np.maximum(self.solved(positions, leaves) @ self.weights, self.darkness)
        out = np.empty((len(positions), self.emission.shape[1]))

        def work(start: int, stop: int) -> None:
            gather_over_links(
                positions, normals, leaves, expected, self.accuracy, self.tree.parent, over, lit,
                self.emission, elements, light, most, ON_PLANE * self.surfaces.size, start, stop, out,
            )  # fmt: skip

        run_chunks(work, len(positions), _CHUNK, 1)
        return out

    def _elements(self) -> Elements:
        tree = self.tree
        return Elements(
            tree.child, tree.child_count, tree.corners, tree.corner_count, tree.patch, tree.centroid,
            tree.axes, tree.patch_normal, self.obstacles.solid, self.obstacles.bounds,
        )  # fmt: skip

    def solved(self, positions: Points, elements: IntArray) -> Spectra:
        """Irradiance (n, channels) at points on leaves by the solution's own linear functions."""
        return functions_at(self.tree, self.received, positions, elements)

    def at_patches(self, positions: Points, patch: IntArray) -> Spectra:
        """As `solved`, for points on patches (n,), in three channels."""
        found = self.solved(positions, leaves_at(self.tree, positions, patch))
        return np.asarray(np.broadcast_to(np.maximum(found, 0.0), (len(positions), 3)))


def _darkness(state: TransportState) -> float:
    leaves, area = state.tree.leaves, state.tree.area
    received = area[leaves] @ np.maximum(state.received[leaves, 0] @ state.weights, 0.0)
    return _DARKNESS * float(received) / max(float(area[leaves].sum()), 1e-300)


def _light(sources: Sources) -> Light:
    return Light(sources.functions, sources.luminance, sources.spread, sources.slope, sources.extent)
