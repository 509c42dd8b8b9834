"""What has been changed, and how far the light has followed ([G figures 3 to 5]).

An entry lives through three states: nothing of it has been shot yet; it is being shot; it has settled, when
the solution is within its tolerance with nothing left to redistribute. What an edit interrupts stays, with
all that it still has to move. An object that is dragged leaves one removal, from where it was, and one
addition, where it is now, however many places it passed through.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from solver.engine.status import Change, ChangeState

KEPT: Final = 10_000
"""Entries that are remembered, the newest ones."""

_MOVE: Final = "move"


@dataclass(frozen=True)
class Progress:
    """How a solution stands, as far as the log cares."""

    owed: Mapping[int, float]
    """W of luminance that is still to be redistributed for each revision"""
    unshot: float
    """W of luminance that has arrived and is still to be propagated"""
    shots: int
    """Links shot over since the latest edit"""
    is_settled: bool


class ChangeLog:
    """All entries of a session, oldest first."""

    def __init__(self, entries: Sequence[Change] = (), count: int = 0, drags: bool = False) -> None:
        """Go on from `entries` of the `count` that there were; the last one `drags`, if any does."""
        self._entries = list(entries)
        self._count = count
        self._dragged = self._entries[-1] if drags and self._entries else None
        """The addition that stands for the last place of an object that was moved more than once, if it is
        the last entry"""

    @property
    def count(self) -> int:
        """Entries that there ever were, before consecutive moves were folded."""
        return self._count

    @property
    def drags(self) -> bool:
        """Whether the last entry is the addition of an object that may be moved on."""
        return self._dragged is not None

    def add(self, changes: Sequence[Change], progress: Progress | None) -> None:
        """Take in what an edit has changed, and remember how far those before it had got.

        Without `progress` nothing has happened since the last one.
        """
        if progress is not None:
            self._entries = list(_told(self._entries, progress))
        self.recall(changes)

    def recall(self, changes: Sequence[Change]) -> None:
        """Take in what an edit changed of which nobody knows any more how far the light had followed."""
        for change in changes:
            self._append(change)
        self._count += len(changes)
        del self._entries[:-KEPT]

    def entries(self, progress: Progress) -> tuple[Change, ...]:
        """All entries as they stand."""
        told = _told(self._entries, progress)
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


def _told(entries: Sequence[Change], progress: Progress) -> tuple[Change, ...]:
    """The entries with what has been done for them so far."""
    open_ones = [entry for entry in entries if entry.state is not ChangeState.SETTLED]
    energy = _shared_out(open_ones, progress)
    return tuple(
        entry if entry.state is ChangeState.SETTLED else _one(entry, progress, energy[entry.entry])
        for entry in entries
    )


def _shared_out(entries: Sequence[Change], progress: Progress) -> dict[int, float]:
    """W that each open entry has still to move, by its number.

    What was owed for an entry that has been folded away is the next one's.
    """
    energy = {entry.entry: progress.unshot / len(entries) for entry in entries}
    revisions = sorted({entry.revision for entry in entries})
    for revision, owed in progress.owed.items():
        later = revisions[min(bisect_left(revisions, revision), len(revisions) - 1)] if revisions else None
        those = [entry for entry in entries if entry.revision == later]
        for entry in those:
            energy[entry.entry] += owed / len(those)
    return energy


def _one(entry: Change, progress: Progress, energy: float) -> Change:
    shots = entry.shots + progress.shots
    if progress.is_settled:
        state, energy = ChangeState.SETTLED, 0.0
    else:
        state = ChangeState.REDISTRIBUTING if shots > 0 else ChangeState.PENDING
    return replace(entry, state=state, energy_to_redistribute=energy, shots=shots)
