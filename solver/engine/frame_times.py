"""What frames cost those who serve them, so that one with a deadline is begun in time."""

from __future__ import annotations

import math


class FrameTimes:
    """What frames have cost whoever serves them, encoding included, for those with a deadline."""

    def __init__(self) -> None:
        self._seconds = math.nan

    def learn(self, seconds: float) -> None:
        """Take in a frame; the latest ones count most."""
        before = seconds if math.isnan(self._seconds) else self._seconds
        self._seconds = max(seconds, 0.5 * (before + seconds))

    @property
    def expected(self) -> float:
        """Seconds that the next one will cost; 0 while nothing is known."""
        return 0.0 if math.isnan(self._seconds) else self._seconds
