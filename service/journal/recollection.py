"""What a session has come to, told from what is written of it, without any geometry.

It must come to the same as the engine did that took the same steps: the batches that can be taken back and
brought back, the revision, and the numbers of the change log.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from service.journal.documents import (
    ConfigureStep,
    EditStep,
    LoggedChange,
    RedoStep,
    Snapshot,
    Step,
    UndoStep,
)
from solver.document.conversion import document_of, scene_of
from solver.document.edits import Edit, apply_edits
from solver.document.settings import SettingsDocument
from solver.engine.change_log import ChangeLog, Progress
from solver.engine.history import KEPT, Deed, deeds_of, joined, taken_back
from solver.engine.past import Batch, Past
from solver.engine.status import Change, ChangeState
from solver.illumination.settings import LightSettings

_UNKNOWN = Progress({}, 0.0, 0, is_settled=False)


class Recollection:
    """A snapshot, and what has followed."""

    def __init__(self, snapshot: Snapshot, steps: Iterable[Step] = ()) -> None:
        self._origin = snapshot
        self._forgotten: list[Edit] = []
        """Of batches that cannot be taken back any more"""
        self._batches: list[Batch] = [tuple(batch) for batch in snapshot.batches]
        self._undone: list[Batch] = [tuple(batch) for batch in snapshot.undone]
        self._gesture = snapshot.gesture
        self._settings = snapshot.settings.changes_to(LightSettings())
        self._revision = snapshot.revision
        self._log = ChangeLog([_change(entry) for entry in snapshot.log], snapshot.entries, snapshot.drags)
        for step in steps:
            self._take(step)

    @property
    def settings(self) -> LightSettings:
        """What the solve goes by."""
        return self._settings

    def past(self) -> Past:
        """Where an engine goes on from. Raises SceneError."""
        return Past(
            scene=apply_edits(scene_of(self._origin.scene), self._forgotten),
            batches=tuple(self._batches),
            undone=tuple(self._undone),
            revision=self._revision,
            entries=self._log.entries(_UNKNOWN),
            count=self._log.count,
            drags=self._log.drags,
            gesture=self._gesture,
        )

    def snapshot(self) -> Snapshot:
        """All of it, with no steps to follow. Raises SceneError."""
        return snapshot_of(self.past(), self._settings)

    def _take(self, step: Step) -> None:
        match step:
            case ConfigureStep():
                self._settings = step.settings.changes_to(self._settings)
            case EditStep():
                joins = step.gesture is not None and step.gesture == self._gesture and bool(self._batches)
                first = self._batches.pop() if joins else ()
                self._batches.append(joined(first, step.edits))
                self._undone.clear()
                self._gesture = step.gesture
                self._tell(deeds_of(step.edits))
            case UndoStep():
                self._gesture = None
                self._undone.append(self._batches.pop())
                self._tell(taken_back(deeds_of(self._undone[-1])))
            case RedoStep():
                self._gesture = None
                self._batches.append(self._undone.pop())
                self._tell(deeds_of(self._batches[-1]))
        while len(self._batches) > KEPT:
            self._forgotten.extend(self._batches.pop(0))

    def _tell(self, deeds: Sequence[Deed]) -> None:
        self._revision += 1
        first = self._log.count + 1
        self._log.recall(
            [
                Change(number, self._revision, deed.op, deed.object_id, ChangeState.PENDING, 0.0, 0)
                for number, deed in enumerate(deeds, first)
            ]
        )


def snapshot_of(past: Past, settings: LightSettings) -> Snapshot:
    """The snapshot of a session that stands at `past`."""
    return Snapshot(
        kind="halflight-snapshot",
        version=1,
        scene=document_of(past.scene),
        settings=SettingsDocument.describing(settings),
        batches=[list(batch) for batch in past.batches],
        undone=[list(batch) for batch in past.undone],
        revision=past.revision,
        log=[_logged(change) for change in past.entries],
        entries=past.count,
        drags=past.drags,
        gesture=past.gesture,
    )


def _change(logged: LoggedChange) -> Change:
    return Change(logged.entry, logged.revision, logged.op, logged.id, ChangeState.PENDING, 0.0, 0)


def _logged(change: Change) -> LoggedChange:
    return LoggedChange.model_validate(
        {"entry": change.entry, "revision": change.revision, "op": change.op, "id": change.id}
    )
