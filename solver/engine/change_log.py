"""What has been changed, and how far the light has followed ([G figures 3 to 5]).

An entry lives through three states: nothing of it has been shot yet; it is being shot; it has settled, when
the solution is within its tolerance with nothing left to redistribute. What an edit interrupts stays, with
all that it still has to move. An object that is dragged leaves one removal, from where it was, and one
addition, where it is now, however many places it passed through.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from solver.engine.status import Change, ChangeState

KEPT: Final = 10_000
"""Entries that are remembered, the newest ones."""

_MOVE: Final = "move"


@dataclass(frozen=True)
class Progress:
    """How a solution stands, as far as the log cares."""

    share_done: float
    """0 to 1 of the way from the latest edit to a settled solution"""
    shots: int
    """Links shot over since then"""
    is_settled: bool


class ChangeLog:
    """All entries of a session, oldest first."""

    def __init__(self) -> None:
        self._entries: list[Change] = []
        self._count = 0
        self._dragged: Change | None = None
        """The addition that stands for the last place of an object that was moved more than once, if it is
        the last entry"""

    @property
    def count(self) -> int:
        """Entries that there ever were, before consecutive moves were folded."""
        return self._count

    def add(self, changes: Sequence[Change], progress: Progress) -> None:
        """Take in what an edit has changed, and remember how far those before it had got."""
        self._entries = [_told(entry, progress) for entry in self._entries]
        for change in changes:
            self._append(change)
        self._count += len(changes)
        del self._entries[:-KEPT]

    def entries(self, progress: Progress) -> tuple[Change, ...]:
        """All entries as they stand."""
        told = tuple(_told(entry, progress) for entry in self._entries)
        if progress.is_settled:
            self._entries = list(told)
        return told

    def _append(self, change: Change) -> None:
        last = self._entries[-1] if self._entries else None
        dragged, self._dragged = self._dragged, None
        if change.op == _MOVE and last is not None and last.id == change.id:
            if dragged is not None:
                # Of where it was in between nothing has to stay.
                self._entries.pop()
            elif last.op == _MOVE:
                self._entries[-1] = replace(last, op="remove")
            if dragged is not None or last.op == _MOVE:
                change = self._dragged = replace(change, op="add")
        self._entries.append(change)


def _told(entry: Change, progress: Progress) -> Change:
    """An entry with what has been done for it so far."""
    if entry.state is ChangeState.SETTLED:
        return entry
    if progress.is_settled:
        return replace(
            entry,
            state=ChangeState.SETTLED,
            energy_to_redistribute=0.0,
            shots=entry.shots + progress.shots,
        )
    begun = progress.share_done > 0.0 or entry.shots > 0 or progress.shots > 0
    return replace(
        entry,
        state=ChangeState.REDISTRIBUTING if begun else ChangeState.PENDING,
        energy_to_redistribute=entry.energy_to_redistribute * (1.0 - progress.share_done),
        shots=entry.shots + progress.shots,
    )
