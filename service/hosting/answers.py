"""What a worker answers: requests put to the engine, and the engine's errors as refusals."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from typing import Final

from service.hosting.messages import (
    AnyRequest,
    ApplyEdits,
    Configure,
    EditsAnswer,
    FrameAnswer,
    GetFrame,
    GetLog,
    GetPick,
    GetScene,
    GetStatus,
    Probe,
    Redo,
    Refusal,
    RefusalKind,
    SceneAnswer,
    Undo,
)
from service.hosting.pictures import Picture, picture, presented
from solver.engine.drawing import encode
from solver.engine.engine import Engine
from solver.engine.history import NothingToReverseError
from solver.engine.overlays.base import NotReadyError
from solver.engine.requests import FrameRequest, LayerName, NotAvailableError
from solver.engine.views import Frame, Outlook
from solver.errors import (
    LimitExceededError,
    RenderingUnavailableError,
    RevisionConflictError,
    SceneError,
    SolverError,
)
from solver.rendering.encoding import EncodingError, LinearFormat, PictureFormat

REFUSED: Final = (SolverError, MemoryError)
"""What an engine raises on purpose, having changed nothing."""

CHANGING: Final = (ApplyEdits, Configure, Redo, Undo)
"""Requests after which the light is another one"""


def answer(engine: Engine, request: AnyRequest) -> object:
    """Put a request to the engine. Raises one of REFUSED."""
    match request:
        case GetStatus():
            return engine.status()
        case GetScene():
            return SceneAnswer(engine.revision, engine.scene)
        case Configure(wanted):
            engine.configure(wanted.changes_to(engine.settings))
            return engine.status()
        case ApplyEdits(edits, if_revision, gesture):
            changes = engine.apply(edits, if_revision, gesture)
            return EditsAnswer(engine.revision, changes)
        case Undo():
            changes = engine.undo()
            return EditsAnswer(engine.revision, changes)
        case Redo():
            changes = engine.redo()
            return EditsAnswer(engine.revision, changes)
        case GetLog():
            return EditsAnswer(engine.revision, engine.log())
        case GetPick(camera, x, y):
            return engine.pick(camera, x, y)
        case Probe(positions, normals):
            return engine.probe(positions, normals)
        case _:
            raise TypeError(f"no answer to {type(request).__name__}")


@dataclass(frozen=True, eq=False)
class DrawnFrame:
    """A frame that has been drawn, and is to be encoded. It needs nothing of the engine any more."""

    frame: Frame
    layer: LayerName
    """That was drawn"""
    request: GetFrame

    @property
    def format(self) -> PictureFormat | LinearFormat:
        """Of its file."""
        return self.request.encoding.format

    def encoded(self) -> FrameAnswer:
        """The answer. Raises one of REFUSED."""
        frame, request = self.frame, self.request
        if request.presentation is None:
            shown = Picture(encode(frame.image, self.layer, request.encoding))
        else:
            shown = picture(frame.image, request.frame.layer, request.encoding, request.presentation)
        height, width = frame.image.shape[:2]
        tag = _tag(frame.outlook, request)
        return FrameAnswer(
            shown.content, tag, frame.outlook, frame.seconds, width, height, shown.scale_maximum
        )


def draw_frame(engine: Engine, request: GetFrame) -> FrameAnswer | DrawnFrame:
    """The frame as well as it can be drawn now; not drawn if the client has it. Raises one of REFUSED."""
    wanted = drawn(engine, request)
    outlook = engine.outlook(wanted)
    tag = _tag(outlook, request)
    if tag in request.known_tags:
        return FrameAnswer(None, tag, outlook, 0.0)
    return DrawnFrame(engine.frame(wanted), wanted.layer, request)


def drawn(engine: Engine, request: GetFrame) -> FrameRequest:
    """What is drawn to answer `request`. Raises one of REFUSED."""
    if request.presentation is None:
        return request.frame
    return presented(engine, request.frame, request.presentation)


def _tag(outlook: Outlook, request: GetFrame) -> str:
    """An entity tag: the same for the same picture in the same encoding."""
    shown = replace(request.frame, max_error=math.inf)  # how good it was to be is no part of a picture
    asked = f"{outlook.tag} {shown} {request.encoding} {request.presentation}"
    return hashlib.blake2s(asked.encode(), digest_size=12).hexdigest()


def refusal_of(error: SolverError | MemoryError) -> Refusal:
    """How a refused request is told."""
    match error:
        case SceneError():
            return Refusal(RefusalKind.INVALID, error.message, error.location)
        case EncodingError():
            return Refusal(RefusalKind.INVALID, str(error), ("format",))
        case NothingToReverseError():
            return Refusal(RefusalKind.NOTHING, str(error))
        case RevisionConflictError():
            return Refusal(RefusalKind.CONFLICT, str(error))
        case LimitExceededError():
            return Refusal(RefusalKind.LIMIT, str(error))
        case NotAvailableError():
            return Refusal(RefusalKind.NOT_AVAILABLE, str(error), (error.what,))
        case NotReadyError():
            return Refusal(RefusalKind.NOT_READY, str(error))
        case RenderingUnavailableError():
            return Refusal(RefusalKind.NO_RENDERING, str(error))
        case MemoryError():
            return Refusal(RefusalKind.LIMIT, "this needs more memory than there is")
        case _:
            return Refusal(RefusalKind.INVALID, str(error))
