"""A session as it is kept: a snapshot of it, and the steps since, as JSON."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field, TypeAdapter

from solver.document.edits import Edit
from solver.document.fields import Closed, Identifier
from solver.document.models import SceneDocument
from solver.document.settings import SettingsDocument
from solver.engine import change_log, history

_Ordinal: TypeAlias = Annotated[int, Field(strict=True, ge=0, lt=2**53)]
Gesture: TypeAlias = Annotated[str, Field(strict=True, min_length=1, max_length=200)]
_Batch: TypeAlias = Annotated[list[Edit], Field(min_length=1)]
_Batches: TypeAlias = Annotated[list[_Batch], Field(max_length=history.KEPT)]


class LoggedChange(Closed):
    """An entry of the change log, without what the light decides."""

    entry: _Ordinal
    revision: _Ordinal
    op: Literal["add", "remove", "move", "set_material", "set_mesh"]
    id: Identifier


class Snapshot(Closed):
    """All of a session but its light: to be kept as a file, and to be brought back from one."""

    kind: Literal["halflight-snapshot"]
    version: Literal[1]
    scene: SceneDocument = Field(description="The scene before the oldest of `batches`.")
    settings: SettingsDocument = SettingsDocument()
    batches: _Batches = Field(default=[], description="Edit batches that stand, oldest first.")
    undone: _Batches = Field(
        default=[], description="Batches that can be brought back; the one taken back last is the last."
    )
    revision: Annotated[_Ordinal, Field(ge=1)] = 1
    log: list[LoggedChange] = Field(
        default=[], max_length=change_log.KEPT, description="The change log, oldest entries first."
    )
    entries: _Ordinal = Field(default=0, description="Entries of the change log that there ever were.")
    drags: bool = Field(
        default=False, description="Whether the last entry of the log is an object's that is being moved."
    )
    gesture: Gesture | None = Field(
        default=None, description="That the last of `batches` is part of, and edits to come may be."
    )


class EditStep(Closed):
    """A batch was applied."""

    step: Literal["edit"]
    edits: list[Edit]
    gesture: Gesture | None = None


class UndoStep(Closed):
    """The newest batch was taken back."""

    step: Literal["undo"]


class RedoStep(Closed):
    """The batch that was taken back last was brought back."""

    step: Literal["redo"]


class ConfigureStep(Closed):
    """Settings were changed: those that are given."""

    step: Literal["configure"]
    settings: SettingsDocument


Step: TypeAlias = EditStep | UndoStep | RedoStep | ConfigureStep

_STEP: Final[TypeAdapter[Step]] = TypeAdapter(Annotated[Step, Field(discriminator="step")])


def text_of(document: Step | Snapshot | SettingsDocument) -> bytes:
    """A document as it is written."""
    # What was not given must not be: a transform has either a matrix or parts.
    return document.model_dump_json(exclude_unset=True).encode()


def read_step(text: bytes) -> Step:
    """The step that `text_of` wrote. Raises ValidationError."""
    return _STEP.validate_json(text)


def read_snapshot(text: bytes) -> Snapshot:
    """The snapshot that `text_of` wrote. Raises ValidationError."""
    return Snapshot.model_validate_json(text)
