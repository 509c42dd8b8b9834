"""Edit batches taken back and brought back.

Scenes are immutable and share what they have in common, so that the scene before a batch is kept as it was.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from solver.document.edits import Edit
from solver.errors import SolverError
from solver.geometry.scene import Scene
from solver.types import ObjectId

KEPT: Final = 1000
"""Batches that can be taken back, the newest ones."""

_INVERSE: Final = {"add": "remove", "remove": "add"}
"""What takes back what; moves, materials and meshes are taken back by their like."""


class NothingToReverseError(SolverError):
    """There is no batch to take back, or none that was."""

    def __init__(self, what: str) -> None:
        self.what = what
        super().__init__(f"there is nothing to {what}")


@dataclass(frozen=True)
class Deed:
    """What happens to one object."""

    op: str
    object_id: ObjectId


@dataclass(frozen=True, eq=False)
class Step:
    """From one scene to another."""

    scene: Scene
    """the one it leads to"""
    deeds: tuple[Deed, ...]


class History:
    """The steps that led to the scene as it stands, and those that were taken back."""

    def __init__(self) -> None:
        self._past: deque[tuple[Scene, Step]] = deque(maxlen=KEPT)
        self._future: list[tuple[Scene, Step]] = []

    @classmethod
    def of(cls, past: Iterable[tuple[Scene, Step]], future: Iterable[tuple[Scene, Step]]) -> History:
        """The history of steps, each with the scene before it: those that stand, oldest first, and those that
        were taken back, the latest last."""
        history = cls()
        history._past.extend(past)
        history._future.extend(future)
        return history

    def record(self, before: Scene, step: Step) -> None:
        """Take in a step of the client's own; what was taken back before cannot be brought back any more."""
        self._past.append((before, step))
        self._future.clear()

    def undo(self) -> Step:
        """The step that takes back the newest batch. Raises NothingToReverseError."""
        if not self._past:
            raise NothingToReverseError("undo")
        before, step = self._past.pop()
        self._future.append((before, step))
        return Step(before, taken_back(step.deeds))

    def redo(self) -> Step:
        """The step that brings back what was taken back last. Raises NothingToReverseError."""
        if not self._future:
            raise NothingToReverseError("redo")
        before, step = self._future.pop()
        self._past.append((before, step))
        return step


def step_of(edits: Sequence[Edit], scene: Scene) -> Step:
    """The step of `edits` to `scene`."""
    return Step(scene, deeds_of(edits))


def deeds_of(edits: Sequence[Edit]) -> tuple[Deed, ...]:
    """What `edits` do, in their order."""
    return tuple(Deed(edit.op, edit.object_id) for edit in edits)


def taken_back(deeds: Sequence[Deed]) -> tuple[Deed, ...]:
    """What takes back `deeds`, in its order."""
    return tuple(Deed(_INVERSE.get(deed.op, deed.op), deed.object_id) for deed in reversed(deeds))
