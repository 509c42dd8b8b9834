"""Links between elements: who exchanges light with whom, how much, and past what ([H B.4.3])."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Final

import numpy as np

from solver import tolerances
from solver.engine.overlays.base import FIRST_PAGE, Overlay, Page, Shown, Subject, Work, index_of
from solver.engine.overlays.shapes import BLACK, GREEN, PINK, WHITE, Primitives, Shapes, faces, outlines
from solver.transport.state import TransportState
from solver.types import BoolArray, IntArray
from solver.visibility.pair_rays import STRATA
from solver.visibility.shafts import FULL, NONE, PARTIAL

VISIBILITIES: Final = {FULL: "full", PARTIAL: "partial", NONE: "none"}
"""Names of the visibility classes"""

_COLOURS: Final = np.array([WHITE, GREEN, BLACK])
"""By visibility class"""

_AT_ONCE: Final = 1 << 15
"""Links looked at between two yields"""


class LinkKind(StrEnum):
    """Which links are shown."""

    FULL = "full"
    PARTIAL = "partial"
    NONE = "none"
    PLANE = "plane"
    """Those one of whose ends reaches through the plane of the other, whatever they see"""


@dataclass(frozen=True)
class LinksOverlay(Overlay):
    """Links, of one element or of all."""

    name: ClassVar[str] = "links"
    element: int | None = None
    """Only links with this end"""
    kind: LinkKind | None = None
    page: Page = FIRST_PAGE

    def show(self, subject: Subject) -> Work:
        """One item a link. Raises SceneError naming `element`."""
        yield
        state, surfaces = subject.solution.solver.state, subject.world.surfaces
        # Refinement puts new columns in the place of these; between two yields it may.
        tree, links = state.tree, state.links
        version, all_p, all_q, all_kinds = subject.solution.version, links.p, links.q, links.kind
        exchange, fraction = links.exchange, links.visibility
        samples, blockers = links.samples, links.blocker_count
        chosen = np.ones(len(links), dtype=np.bool_)
        if self.element is not None:
            index_of(self.element, len(tree), "element", "elements")
            chosen = (all_p == self.element) | (all_q == self.element)
        kinds = np.bincount(all_kinds[chosen], minlength=len(VISIBILITIES))
        for kind, name in VISIBILITIES.items():
            if self.kind == name:
                chosen &= all_kinds == kind
        ids = np.flatnonzero(chosen).astype(np.int32)
        if self.kind is LinkKind.PLANE:
            ids = ids[(yield from _crossing(state, all_p[ids], all_q[ids]))]
        shown = self.page.of(ids)
        p, q, kind_of = all_p[shown], all_q[shown], all_kinds[shown]
        crosses = yield from _crossing(state, p, q)
        ends = np.stack([tree.centroid[p], tree.centroid[q]], axis=1)
        colour = np.where(crosses[:, None], PINK, _COLOURS[kind_of])
        names = np.array(list(VISIBILITIES.values()), dtype=object)
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(ids),
            facts={
                "solution": version,
                "objects": surfaces.object_ids,
                "counts": {name: int(kinds[kind]) for kind, name in VISIBILITIES.items()},
            },
            columns={
                "link": shown,
                "p": p,
                "q": q,
                "object_p": surfaces.object[tree.patch[p]],
                "object_q": surfaces.object[tree.patch[q]],
                "ends": ends,
                "visibility": names[kind_of].tolist(),
                "crosses_plane": crosses,
                "form_factor_pq": exchange[shown] / tree.area[p],
                "form_factor_qp": exchange[shown] / tree.area[q],
                "exchange": exchange[shown],
                "visible_fraction": fraction[shown],
                "samples": STRATA * samples[shown],
                "blockers": blockers[shown],
                "rgb": colour,
            },
            shapes=Shapes(lines=Primitives.of(ends, colour)),
        )


def _crossing(state: TransportState, first: IntArray, second: IntArray) -> Generator[None, None, BoolArray]:
    """(n,) whether one of two elements (n,) reaches through the plane of the other."""
    tree = state.tree
    tolerance = tolerances.SIDE * state.surfaces.size
    crosses = np.zeros(len(first), dtype=np.bool_)
    for start in range(0, len(first), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        for a, b in ((first[part], second[part]), (second[part], first[part])):
            offset = tree.corners[a] - tree.corners[b][:, :1]
            height = np.einsum("nka,na->nk", offset, tree.patch_normal[tree.patch[b]])
            crosses[part] |= (height.min(axis=1) < -tolerance) & (height.max(axis=1) > tolerance)
        yield
    return crosses


@dataclass(frozen=True)
class BlockersOverlay(Overlay):
    """What may stand between the ends of one link."""

    link: int
    name: ClassVar[str] = "blockers"

    def show(self, subject: Subject) -> Work:
        """One item a blocker. Raises SceneError naming `link`."""
        yield
        state, surfaces = subject.solution.solver.state, subject.world.surfaces
        tree, links = state.tree, state.links
        k = index_of(self.link, len(links), "link", "links")
        first = int(links.blocker_start[k])
        patch = links.pool[first : first + int(links.blocker_count[k])]
        corners, count = surfaces.corners[patch], surfaces.corner_count[patch]
        ends = np.array([links.p[k], links.q[k]], dtype=np.int32)
        end_corners, end_count = tree.corners[ends], tree.corner_count[ends]
        exchange = float(links.exchange[k])
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(patch),
            facts={
                "solution": subject.solution.version,
                "objects": surfaces.object_ids,
                "link": k,
                "visibility": VISIBILITIES[int(links.kind[k])],
                "visible_fraction": float(links.visibility[k]),
                "samples": STRATA * int(links.samples[k]),
                "exchange": exchange,
                "ends": [
                    {
                        "element": int(element),
                        "patch": int(tree.patch[element]),
                        "object": int(surfaces.object[tree.patch[element]]),
                        "corners": tree.corners[element, : tree.corner_count[element]].tolist(),
                        "form_factor": exchange / float(tree.area[element]),
                    }
                    for element in ends
                ],
            },
            columns={
                "patch": patch,
                "object": surfaces.object[patch],
                "face": surfaces.face[patch],
                "corners": corners,
                "corner_count": count,
            },
            shapes=Shapes(
                lines=outlines(end_corners, end_count, BLACK) + outlines(corners, count, PINK),
                triangles=faces(end_corners, end_count, WHITE),
            ),
        )
