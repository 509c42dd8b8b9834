"""Which patches an edit leaves as they were ([G "Modification of an existing radiosity solution"])."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.types import IntArray


@dataclass(frozen=True, eq=False)
class Match:
    """Patches of two revisions of a scene; those of an object stay or go together."""

    number: IntArray
    """(p before,) the later number of a patch whose geometry is the same, to the last bit; else -1"""
    likeness: IntArray
    """(p after,) the earlier number of the same patch, or of the same part of a moved object; else -1"""

    @property
    def gone(self) -> IntArray:
        """Earlier patches that are no longer where they were."""
        return np.flatnonzero(self.number < 0).astype(np.int32)

    @property
    def fresh(self) -> IntArray:
        """Later patches that were not there before."""
        stays = np.zeros(len(self.likeness), dtype=np.bool_)
        stays[self.number[self.number >= 0]] = True
        return np.flatnonzero(~stays).astype(np.int32)

    @property
    def only_moves(self) -> bool:
        """Whether all patches have the numbers that they had, wherever they are."""
        return len(self.number) == len(self.likeness) and np.array_equal(
            self.likeness, np.arange(len(self.likeness))
        )


def match_patches(before: Surfaces, after: Surfaces) -> Match:
    """What the patches of one revision are in the next."""
    number = np.full(before.patch_count, -1, dtype=np.int32)
    likeness = np.full(after.patch_count, -1, dtype=np.int32)
    earlier = dict(zip(before.object_ids, _ranges(before), strict=True))
    for name, new in zip(after.object_ids, _ranges(after), strict=True):
        old = earlier.get(name)
        if old is None or old.stop - old.start != new.stop - new.start:
            continue
        if not (
            np.array_equal(before.corner_count[old], after.corner_count[new])
            and np.array_equal(before.side[old], after.side[new])
        ):
            continue
        likeness[new] = np.arange(old.start, old.stop, dtype=np.int32)
        if np.array_equal(before.corners[old], after.corners[new]):
            number[old] = np.arange(new.start, new.stop, dtype=np.int32)
    return Match(number, likeness)


def _ranges(surfaces: Surfaces) -> list[slice]:
    """The patches of each object, which stand side by side."""
    ends = np.searchsorted(
        surfaces.object, np.arange(len(surfaces.object_ids) + 1, dtype=surfaces.object.dtype)
    ).tolist()
    return [slice(start, stop) for start, stop in pairwise(ends)]
