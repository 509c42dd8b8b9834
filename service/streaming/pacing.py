"""How good the frames of a stream are: coarse while its view moves, as good as they get where it rests.

A view moves while cameras, or revisions of the scene, come closer together than `STILL`. How coarse its
frames are then follows from what they take on their way, so that there are always ten a second or more,
if only of few pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

STILL: Final = 0.15
"""Seconds without another camera after which a view rests"""

_TOO_SLOW: Final = 0.09
"""Seconds; frames that take longer are made coarser. A fifth of it may be the solver's step before."""

_QUICK: Final = 0.04
"""Seconds; frames that take less may be finer. The next step has at most 2.3 times the pixels."""


class Quality(StrEnum):
    """What a frame was made for."""

    MOVING = "moving"
    REST = "rest"


@dataclass(frozen=True)
class Coarseness:
    """Of frames of a view that moves."""

    scale: float
    """Of width and height"""
    quality: int
    """Of lossy pictures, out of 100"""


LADDER: Final = (
    Coarseness(1.0, 80),
    Coarseness(0.75, 75),
    Coarseness(0.5, 75),
    Coarseness(0.375, 65),
    Coarseness(0.25, 55),
)
"""From fine to coarse"""


class Pace:
    """The motion of one client's view. Times are seconds of one clock."""

    def __init__(self) -> None:
        self._last = -math.inf
        self._moving_until = -math.inf
        self._step = LADDER.index(Coarseness(0.5, 75))

    def touch(self, now: float) -> None:
        """The view has changed."""
        if now - self._last < STILL:
            self._moving_until = now + STILL
        self._last = now

    def is_moving(self, now: float) -> bool:
        """Whether the view moves."""
        return now < self._moving_until

    def until_rest(self, now: float) -> float | None:
        """Seconds until the view rests unless it is changed; None where it does."""
        return self._moving_until - now if self.is_moving(now) else None

    @property
    def coarseness(self) -> Coarseness:
        """Of the next frame while the view moves."""
        return LADDER[self._step]

    def took(self, seconds: float) -> None:
        """A frame of a moving view took so long to be made and to arrive."""
        if seconds > _TOO_SLOW:
            self._step = min(self._step + 1, len(LADDER) - 1)
        elif seconds < _QUICK:
            self._step = max(self._step - 1, 0)
