"""What a solution still owes to edits: links that do not know of them yet, and pairs without a link.

A debt has the number of its edit; one that is paid late keeps it, so that the log can tell what is left of
each ([G "Using a log to eliminate error"]). The number is negative where the debt is due to the present place
of an object that is being dragged: when it moves on, such a debt is void, and leaves no trace ([G figure 5]).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.redistribution.matching import Match
from solver.redistribution.reach import COMING, LEAVING, boxes_around, reached_links
from solver.transport.state import TransportState
from solver.types import IntArray


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


def owe(
    state: TransportState, surfaces: Surfaces, match: Match, number: int, margin: float, drags: bool
) -> None:
    """Mark the links of `state` that pass where patches are about to go or to come, in `surfaces`.

    margin: metres. `drags`: what moves is what was moved before, and debts for where it is now are void.
    """
    links = state.links
    waiting = links.debt < 0
    links.debt[waiting] = 0 if drags else -links.debt[waiting]
    gone, fresh = match.gone, match.fresh
    if len(gone) + len(fresh) == 0:
        return
    leaving = boxes_around(state.surfaces.corners[gone], state.surfaces.object[gone])
    coming = boxes_around(surfaces.corners[fresh], surfaces.object[fresh])
    reached = reached_links(state.tree, links, leaving, coming, margin)
    debt = links.debt
    left = (reached & LEAVING != 0) & (debt == 0)
    if drags:
        # Links in debt to the place that is left have never known it.
        left &= ~waiting
    debt[left] = number
    debt[(reached & COMING != 0) & (debt == 0)] = -number
