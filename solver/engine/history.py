"""Edit batches taken back and brought back.

Scenes are immutable and share their objects, so that of the scene before a batch only those are kept that the
batch has changed: a whole scene knows all of its objects by name, which of a thousand scenes is not little.
They are kept bare, without what has been made of them, which lives as long as they do and may be far more.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol, TypeVar

from solver.document.edits import Edit
from solver.errors import SolverError
from solver.geometry.scene import Scene, SceneObject
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


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, eq=False, slots=True)
class Difference:
    """What makes one scene of another, both of the same cameras."""

    changed: tuple[SceneObject, ...]
    """Objects of the other one that are not in the first, or not as they are"""
    gone: tuple[ObjectId, ...]
    """Objects that the other one has not"""
    places: tuple[tuple[int, ObjectId], ...]
    """Where among the objects of the other one those are that the first has not"""

    @staticmethod
    def between(scene: Scene, other: Scene) -> Difference:
        """What makes `other` of `scene`."""
        first, then = scene.objects, other.objects
        changed = tuple(_bare(thing) for id, thing in then.items() if first.get(id) is not thing)
        gone = tuple(id for id in first if id not in then)
        places = tuple((place, id) for place, id in enumerate(then) if id not in first)
        if _ordered(first, gone, places) != list(then):
            # What was taken away and put back has another place.
            gone, places = tuple(first), tuple(enumerate(then))
        return Difference(changed, gone, places)

    def of(self, scene: Scene) -> Scene:
        """The other one, from the first."""
        things = {**scene.objects, **{thing.id: _bare(thing) for thing in self.changed}}
        if self.gone or self.places:
            things = {id: things[id] for id in _ordered(scene.objects, self.gone, self.places)}
        return replace(scene, objects=things)


def _bare(thing: SceneObject) -> SceneObject:
    """The same object, of which nothing has been made yet."""
    return replace(thing)


def _ordered(
    ids: Iterable[ObjectId], gone: Collection[ObjectId], places: Iterable[tuple[int, ObjectId]]
) -> list[ObjectId]:
    """`ids` without those that are gone, and with others at their places, first ones first."""
    left_out = frozenset(gone)
    order = [id for id in ids if id not in left_out]
    for place, id in places:
        order.insert(place, id)
    return order


@dataclass(frozen=True, eq=False, slots=True)
class _Turn:
    """A step, without its scenes."""

    back: Difference
    forth: Difference
    deeds: tuple[Deed, ...]

    @staticmethod
    def of(before: Scene, step: Step) -> _Turn:
        back = Difference.between(step.scene, before)
        return _Turn(back, Difference.between(before, step.scene), step.deeds)


class History:
    """The steps that led to the scene as it stands, and those that were taken back."""

    def __init__(self, gesture: str | None = None) -> None:
        """Nothing has happened yet; what does by `gesture` joins the newest step, if there is one."""
        self._past: deque[_Turn] = deque(maxlen=KEPT)
        self._future: list[_Turn] = []
        self._standing: Scene | None = None
        """As it stands; None while there are no steps"""
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
        for before, step in future:
            history._future.append(_Turn.of(before, step))
            history._standing = before
        for before, step in past:
            history._past.append(_Turn.of(before, step))
            history._standing = step.scene
        return history

    def record(self, before: Scene, step: Step, gesture: str | None = None) -> None:
        """Take in a step of the client's own; what was taken back before cannot be brought back any more.

        One of the same `gesture` as the one before is taken back together with that.
        """
        if gesture is not None and gesture == self._gesture and self._past:
            first = self._past.pop()
            before, step = first.back.of(before), Step(step.scene, joined(first.deeds, step.deeds))
        self._past.append(_Turn.of(before, step))
        self._future.clear()
        self._standing, self._gesture = step.scene, gesture

    def undo(self) -> Step:
        """The step that takes back the newest batch. Raises NothingToReverseError."""
        if not self._past or self._standing is None:
            raise NothingToReverseError("undo")
        turn = self._past.pop()
        self._future.append(turn)
        self._standing, self._gesture = turn.back.of(self._standing), None
        return Step(self._standing, taken_back(turn.deeds))

    def redo(self) -> Step:
        """The step that brings back what was taken back last. Raises NothingToReverseError."""
        if not self._future or self._standing is None:
            raise NothingToReverseError("redo")
        turn = self._future.pop()
        self._past.append(turn)
        self._standing, self._gesture = turn.forth.of(self._standing), None
        return Step(self._standing, turn.deeds)


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
