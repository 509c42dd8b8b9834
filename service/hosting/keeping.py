"""What is written of requests that change a session, and of their answers."""

from __future__ import annotations

import hashlib
from typing import Final

from pydantic import TypeAdapter

from service.hosting.messages import AnyRequest, ApplyEdits, Configure, EditsAnswer, Redo, Undo
from service.journal.documents import ConfigureStep, EditStep, RedoStep, Step, UndoStep, text_of
from solver.document.settings import SettingsDocument
from solver.illumination.settings import LightSettings

_ANSWER: Final = TypeAdapter(EditsAnswer)


def step_of(request: AnyRequest) -> Step | None:
    """The step that `request` takes; None where it changes nothing that is to last."""
    match request:
        case ApplyEdits(edits, _, None):
            return EditStep(step="edit", edits=list(edits))
        case ApplyEdits(edits, _, gesture):
            return EditStep(step="edit", edits=list(edits), gesture=gesture)
        case Undo():
            return UndoStep(step="undo")
        case Redo():
            return RedoStep(step="redo")
        case Configure(changes):
            return ConfigureStep(step="configure", settings=changes)
        case _:
            return None


def digest_of(request: AnyRequest, step: Step) -> bytes:
    """The same for the same request."""
    revision = request.if_revision if isinstance(request, ApplyEdits) else None
    return hashlib.blake2s(text_of(step) + f" {revision}".encode()).digest()


def answer_text(answer: EditsAnswer) -> bytes:
    """An answer as it is written."""
    return _ANSWER.dump_json(answer)


def read_answer(text: bytes) -> EditsAnswer:
    """The answer that `answer_text` wrote."""
    return _ANSWER.validate_json(text)


def settings_text(settings: LightSettings) -> bytes:
    """Settings as they are written."""
    return text_of(SettingsDocument.describing(settings))
