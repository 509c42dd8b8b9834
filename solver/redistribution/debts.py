"""What a solution still owes to edits: links that do not know of them yet, and pairs without a link.

A debt has the number of its edit; one that is paid late keeps it, so that the log can tell what is left of
each ([G "Using a log to eliminate error"]). The number is negative where the debt is due to the present place
of an object that is being dragged: when it moves on, such a debt is void, and leaves no trace ([G figure 5]).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.kernels import inline_kernel, kernel
from solver.parallel import run_chunks
from solver.redistribution.matching import Match
from solver.redistribution.reach import bounds_of, boxes_around, hull_meets
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray

_CHUNK: Final = 1 << 15


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
    links, tree = state.links, state.tree
    gone, fresh = match.gone, match.fresh
    leaving = boxes_around(state.surfaces.corners[gone], state.surfaces.object[gone])
    coming = boxes_around(surfaces.corners[fresh], surfaces.object[fresh])
    for boxes in (leaving, coming):
        boxes[:, 0] -= margin
        boxes[:, 1] += margin
    bounds = bounds_of(tree)

    def work(start: int, stop: int) -> None:
        _owe(links.p, links.q, bounds, leaving, coming, number, drags, start, stop, links.debt)

    run_chunks(work, len(links), _CHUNK)


@inline_kernel
def _meets(first: FloatArray, second: FloatArray, boxes: FloatArray) -> bool:
    for k in range(len(boxes)):
        if hull_meets(first[0], first[1], second[0], second[1], boxes[k, 0], boxes[k, 1]):
            return True
    return False


@kernel
def _owe(
    p: IntArray,
    q: IntArray,
    bounds: FloatArray,
    leaving: FloatArray,
    coming: FloatArray,
    number: int,
    drags: bool,
    start: int,
    stop: int,
    debt: IntArray,
) -> None:
    for link in range(start, stop):
        owed = debt[link]
        waits = owed < 0
        if waits:
            owed = 0 if drags else -owed
        if owed == 0:
            i = p[link]
            j = q[link]
            # Links in debt to a place that is left have never known it.
            knew = not (waits and drags)
            if knew and _meets(bounds[i], bounds[j], leaving):
                owed = number
            elif _meets(bounds[i], bounds[j], coming):
                owed = -number
        if owed != debt[link]:
            debt[link] = owed
