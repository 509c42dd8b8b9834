"""What edits have done to the light since a solution was looked at closely, and to whom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.kernels import kernel
from solver.redistribution.carrying import Carried
from solver.redistribution.matching import Match
from solver.transport.elements import ElementTree
from solver.types import FloatArray, IntArray


@dataclass(eq=False)
class Trace:
    """Since some earlier solution, over one or more edits."""

    patch: IntArray
    """(p,) the number that each patch had then, -1 where it was not there"""
    disturbed: FloatArray
    """(n,) luminance irradiance, W/m2, over an element's own links, that came or went because something is
    seen or hidden; of elements that came since, nothing is known beyond their parents'"""

    @staticmethod
    def after(earlier: Trace | None, match: Match, carried: Carried) -> Trace:
        """After one more edit; of that edit alone where there is no earlier trace."""
        stays = np.flatnonzero(match.number >= 0)
        patch = np.full(len(match.likeness), -1, dtype=np.int32)
        patch[match.number[stays]] = stays if earlier is None else earlier.patch[stays]
        disturbed = carried.dimmed
        if earlier is not None:
            known = np.flatnonzero((carried.source >= 0) & (carried.source < len(earlier.disturbed)))
            disturbed[known] += earlier.disturbed[carried.source[known]]
        return Trace(patch, disturbed)

    def disturb(self, p: IntArray, q: IntArray, to_p: FloatArray, to_q: FloatArray) -> None:
        """Take in luminance irradiance (k,), W/m2, by which links between p and q (k,) change, up or down."""
        n = len(self.disturbed)
        for element, change in ((p, to_p), (q, to_q)):
            self.disturbed += np.bincount(element, np.abs(change), n)[:n]

    def keep(self, elements: IntArray) -> None:
        """Only some elements (k,), ascending, are there from now on."""
        self.disturbed = self.disturbed[elements[elements < len(self.disturbed)]]

    def at_elements(self, tree: ElementTree) -> FloatArray:
        """The same (n,) over the links of an element and of all that hold it."""
        total = np.zeros(len(tree))
        total[: len(self.disturbed)] = self.disturbed
        _push_down(tree.parent, total)
        return total


@kernel
def _push_down(parent: IntArray, total: FloatArray) -> None:
    for e in range(len(parent)):
        if parent[e] >= 0:
            total[e] += total[parent[e]]
