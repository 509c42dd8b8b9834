"""Which elements of a sampled field are split: those within which light varies more than may be.

An element splits where its siblings differ by more than noise, and its children then get samples of their
own: they split again only if they differ. Elements have a least area, which ends this.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.engine.sampled_error import SampledError
from solver.transport.elements import ElementTree
from solver.transport.field import SolveOutcome
from solver.transport.settings import SolverSettings
from solver.types import IntArray

VARIATION: Final = 0.5
"""Part of the tolerance that light which varies within elements may take."""

DECIDED: Final = 0.3
"""Part of the tolerance that noise has left when it is decided that only smaller elements would help."""

GROWTH: Final = 0.125
"""Part of the leaves that split at once, at most."""

_CHILDREN: Final = 4
"""Of an element, at most."""


def choose_splits(
    tree: ElementTree, leaves: IntArray, error: SampledError, settings: SolverSettings, least_area: float
) -> IntArray | SolveOutcome:
    """The worst of `leaves`, ascending, none while noise hides them; or why what is wrong cannot be mended.

    `least_area` m2 is that of elements unless the settings say.
    """
    none = np.empty(0, dtype=np.int32)
    aim = (VARIATION * settings.error_tolerance) ** 2
    variation, noise = float(error.variation.max()), float(error.noise.max())
    if variation <= aim or noise > variation:
        return none
    least = least_area if settings.minimum_area is None else settings.minimum_area
    worth = np.where(tree.area[leaves] >= _CHILDREN * least, error.excess, 0.0)
    order = np.argsort(-worth)
    enough = 1 + int(np.searchsorted(np.cumsum(worth[order]), variation - aim))
    wanted = min(enough, int(np.count_nonzero(worth)), 1 + int(GROWTH * len(leaves)))
    chosen = min(wanted, (settings.max_elements - len(tree)) // _CHILDREN)
    if chosen > 0:
        return np.sort(leaves[order[:chosen]])
    if noise > (DECIDED * settings.error_tolerance) ** 2 or variation <= settings.error_tolerance**2:
        return none
    return SolveOutcome.ELEMENT_LIMIT if wanted > 0 else SolveOutcome.MINIMUM_AREA
