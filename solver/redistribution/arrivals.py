"""What redistribution has brought to elements, and what stands for the light that is still to come."""

from __future__ import annotations

import numpy as np

from solver.arrays import GrowingArray
from solver.redistribution.carrying import Shots
from solver.transport.state import TransportState
from solver.types import FloatArray, IntArray


class Arrivals:
    """Light that links have brought to their ends since these were last told.

    Patches that came with an edit show a guess of their irradiance, less and less of it as light arrives.
    """

    def __init__(self, state: TransportState, fresh: IntArray) -> None:
        """Nothing has arrived yet; the patches `fresh` (k,) have a guess as their irradiance."""
        self._state = state
        self._arrived: GrowingArray[np.float64] | None = None
        self._fresh = self._guessed = fresh
        self._guess = state.received[fresh, 0].copy()
        self._shown = 1.0
        self.to_come = 1.0
        """Part of the light that is still to come, for which a guess stands"""

    def shoot(self, shots: Shots, moments: FloatArray) -> None:
        """Let links bring what elements send by their `moments` (n, 3, channels)."""
        tree = self._state.tree
        if self._arrived is None:
            self._arrived = GrowingArray.of(np.zeros_like(self._state.received))
        # Elements may have been divided since.
        self._arrived.grow(len(tree) - len(self._arrived))
        shots.shoot(tree.area, moments, self._arrived.live)

    def take_in(self) -> None:
        """Let elements receive what has arrived, and keep of the guess what is still to come."""
        if self._arrived is not None:
            self._arrived.grow(len(self._state.tree) - len(self._arrived))
            self._state.add_received(self._arrived.live)
            self._arrived = None
        if self._shown != self.to_come:
            self._state.received[self._guessed, 0] -= (self._shown - self.to_come) * self._guess
            self._shown = self.to_come

    def spread_guess(self) -> None:
        """What is guessed of patches is guessed of all that has become of them."""
        tree = self._state.tree
        place = np.full(tree.patch_count, -1, dtype=np.int32)
        place[self._fresh] = np.arange(len(self._fresh), dtype=np.int32)
        # Patches are the first elements.
        guess = self._guess[: len(self._fresh)]
        self._guessed = np.flatnonzero(place[tree.patch] >= 0).astype(np.int32)
        self._guess = guess[place[tree.patch[self._guessed]]]
