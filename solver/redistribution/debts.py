"""What a solution still owes to edits: links that do not know of them yet, and pairs without a link.

A debt has the number of its edit; one that is paid late keeps it, so that the log can tell what is left of
each ([G "Using a log to eliminate error"]). The number is negative where the debt is due to the present place
of an object that is being dragged: when it moves on, such a debt is void, and leaves no trace ([G figure 5]).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.redistribution.matching import Match
from solver.redistribution.reach import boxes_around, reached_links
from solver.transport.elements import ElementTree
from solver.transport.links import LinkTable
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class UnlinkedPairs:
    """Pairs of patches (k,) that are to be linked."""

    p: IntArray
    q: IntArray
    debt: IntArray
    """(k,) number of the edit"""

    @staticmethod
    def none() -> UnlinkedPairs:
        """No pairs."""
        empty = np.empty(0, dtype=np.int32)
        return UnlinkedPairs(empty, empty, empty)

    def __len__(self) -> int:
        return len(self.p)

    def carried(self, match: Match) -> UnlinkedPairs:
        """Those whose patches an edit left alone, by their new numbers."""
        p, q = match.number[self.p], match.number[self.q]
        kept = (p >= 0) & (q >= 0)
        return UnlinkedPairs(np.minimum(p, q)[kept], np.maximum(p, q)[kept], np.abs(self.debt[kept]))

    def joined(self, other: UnlinkedPairs) -> UnlinkedPairs:
        """These and others."""
        return UnlinkedPairs(
            np.concatenate([self.p, other.p]),
            np.concatenate([self.q, other.q]),
            np.concatenate([self.debt, other.debt]),
        )

    def without(self, first: int) -> UnlinkedPairs:
        """All but the first ones."""
        return UnlinkedPairs(self.p[first:], self.q[first:], self.debt[first:])


def owe_for_leaving(state: TransportState, match: Match, number: int, margin: float, drags: bool) -> None:
    """Mark the links of `state` that pass where patches are that are about to go.

    `drags`: what goes is what was dragged before, and debts for where it is now are void.
    """
    links = state.links
    void = links.debt < 0
    links.debt[void] = 0 if drags else -links.debt[void]
    if drags:
        # Links in debt to the place that is left have never known it.
        waiting = np.flatnonzero(void)
    gone = match.gone
    if len(gone) == 0:
        return
    reached = _reached(state.tree, links, gone, state.surfaces.object, margin)
    if drags:
        reached = np.setdiff1d(reached, waiting, assume_unique=True)
    links.debt[reached] = np.where(links.debt[reached] == 0, number, links.debt[reached])


def owe_for_coming(state: TransportState, match: Match, number: int, margin: float) -> None:
    """Mark the links of `state` that pass where its fresh patches are."""
    fresh, links = match.fresh, state.links
    if len(fresh) == 0:
        return
    reached = _reached(state.tree, links, fresh, state.surfaces.object, margin)
    links.debt[reached] = np.where(links.debt[reached] == 0, -number, links.debt[reached])


def _reached(
    tree: ElementTree, links: LinkTable, patches: IntArray, owner: IntArray, margin: float
) -> IntArray:
    corners: FloatArray = tree.corners[: tree.patch_count]
    boxes = boxes_around(corners[patches], owner[patches])
    return reached_links(tree, links, boxes, margin)
