"""Edit batches taken back and brought back.

Scenes are immutable and share what they have in common, so that the scene before a batch is kept as it was.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol, TypeVar

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


class _Told(Protocol):
    """What has an operation and an object: a deed, or an edit."""

    @property
    def op(self) -> str: ...
    @property
    def object_id(self) -> ObjectId: ...


T = TypeVar("T", bound=_Told)


@dataclass(frozen=True, eq=False)
class Step:
    """From one scene to another."""

    scene: Scene
    """the one it leads to"""
    deeds: tuple[Deed, ...]


class History:
    """The steps that led to the scene as it stands, and those that were taken back."""

    def __init__(self, gesture: str | None = None) -> None:
        """Nothing has happened yet; what does by `gesture` joins the newest step, if there is one."""
        self._past: deque[tuple[Scene, Step]] = deque(maxlen=KEPT)
        self._future: list[tuple[Scene, Step]] = []
        self._gesture = gesture

    @classmethod
    def of(
        cls,
        past: Iterable[tuple[Scene, Step]],
        future: Iterable[tuple[Scene, Step]],
        gesture: str | None = None,
    ) -> History:
        """The history of steps, each with the scene before it: those that stand, oldest first, and those that
        were taken back, the latest last. The newest was part of `gesture`."""
        history = cls(gesture)
        history._past.extend(past)
        history._future.extend(future)
        return history

    def record(self, before: Scene, step: Step, gesture: str | None = None) -> None:
        """Take in a step of the client's own; what was taken back before cannot be brought back any more.

        One of the same `gesture` as the one before is taken back together with that.
        """
        if gesture is not None and gesture == self._gesture and self._past:
            before, first = self._past.pop()
            step = Step(step.scene, joined(first.deeds, step.deeds))
        self._past.append((before, step))
        self._future.clear()
        self._gesture = gesture

    def undo(self) -> Step:
        """The step that takes back the newest batch. Raises NothingToReverseError."""
        if not self._past:
            raise NothingToReverseError("undo")
        self._gesture = None
        before, step = self._past.pop()
        self._future.append((before, step))
        return Step(before, taken_back(step.deeds))

    def redo(self) -> Step:
        """The step that brings back what was taken back last. Raises NothingToReverseError."""
        if not self._future:
            raise NothingToReverseError("redo")
        self._gesture = None
        before, step = self._future.pop()
        self._past.append((before, step))
        return step


def joined(first: Sequence[T], second: Sequence[T]) -> tuple[T, ...]:
    """Edits or deeds, one after the other; of several moves of an object in a row, say, the last."""
    whole: list[T] = []
    for each in (*first, *second):
        last = whole[-1] if whole else None
        is_like = last is not None and (each.op, each.object_id) == (last.op, last.object_id)
        if is_like and each.op not in _INVERSE:
            whole.pop()
        whole.append(each)
    return tuple(whole)


def step_of(edits: Sequence[Edit], scene: Scene) -> Step:
    """The step of `edits` to `scene`."""
    return Step(scene, deeds_of(edits))


def deeds_of(edits: Sequence[Edit]) -> tuple[Deed, ...]:
    """What `edits` do, in their order."""
    return tuple(Deed(edit.op, edit.object_id) for edit in edits)


def taken_back(deeds: Sequence[Deed]) -> tuple[Deed, ...]:
    """What takes back `deeds`, in its order."""
    return tuple(Deed(_INVERSE.get(deed.op, deed.op), deed.object_id) for deed in reversed(deeds))
