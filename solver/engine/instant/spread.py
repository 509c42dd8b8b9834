"""The error of a mean of blocks, from how they differ."""

from __future__ import annotations

import math
from typing import Final

SAFETY: Final = 1.6
"""Factor on the estimate: few blocks tell too little of rare paths, so that in a half of many rooms frames
erred more than their spread told, in five of six of them by less than this."""


class Spread:
    """Learns the variance of one path's light from blocks of many, the later and larger ones above all."""

    def __init__(self) -> None:
        self._sum = 0.0
        self._paths = 0
        self.estimate = 1.0
        """Relative RMS error of the mean of all blocks; 1 while nothing is known of it"""

    def learn(self, before: int, fresh: int, apart: float, power: float) -> None:
        """Take in a block of `fresh` paths beside the mean of `before` ones.

        `apart` is the squared difference of the two, and `power` the square of the mean of both, over the
        same points. Independent blocks differ by (1 / before + 1 / fresh) times the variance of one path.
        """
        after = before + fresh
        self._sum += fresh * apart * before * fresh / after
        self._paths += fresh
        variance = self._sum / self._paths / after
        self.estimate = min(1.0, SAFETY * math.sqrt(variance / power)) if power > 0.0 else 0.0
