"""What is said on a stream, without the connection: both clients hold the same conversation.

Frames come as two messages, a header and its bytes; answers name the message that they answer.
"""

from __future__ import annotations

import io
import itertools
import json
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from halflight.client.answers import Edited, Status, _Told
from halflight.client.edits import Edit
from halflight.client.errors import ProblemError

ENDED: Final = frozenset({1000, 1001, 1012, 4410})
"""Close codes of a stream that ends because the session, the service or this end does"""

IDLE: Final = 30.0
"""Seconds without a word after which a client says that it is there"""

PING: Final = json.dumps({"type": "ping"})


class StreamLostError(Exception):
    """The stream has ended before the session has: it may be opened again."""

    def __init__(self, code: int, reason: str) -> None:
        self.code = code
        super().__init__(f"the stream has ended ({code}): {reason or 'the connection is lost'}")


@dataclass(frozen=True)
class _Header(_Told):
    number: int
    id: str | None
    revision: int
    error_estimate: float
    converged: bool
    renderer: str
    layer: str
    media_type: str
    width: int
    height: int
    quality: str
    render_ms: float
    scale_maximum: float | None


@dataclass(frozen=True)
class StreamFrame(_Header):
    """A frame that has come on a stream."""

    content: bytes

    @property
    def image(self) -> Image.Image:
        """The picture."""
        return Image.open(io.BytesIO(self.content))

    @property
    def array(self) -> NDArray[Any]:
        """(height, width, 3) sRGB bytes, top row first."""
        return np.asarray(self.image)


class Conversation:
    """What has been said, and what is yet to be read."""

    def __init__(self) -> None:
        self.frames: deque[StreamFrame] = deque()
        """Those that have come and were not looked at"""
        self.status: Status | None = None
        """How the session stands, as it was told last"""
        self._names = map(str, itertools.count(1))
        self._looking: str | None = None
        self._header: dict[str, Any] | None = None
        self._answers: dict[str, Edited | ProblemError] = {}
        self._refusal: ProblemError | None = None

    def look(self, query: Mapping[str, Any]) -> str:
        """Ask for frames of a view."""
        self._looking = next(self._names)
        self._refusal = None
        self.frames.clear()
        given = {name: value for name, value in query.items() if value is not None}
        return json.dumps({**given, "type": "camera", "id": self._looking})

    def edit(self, edits: Sequence[Edit], if_revision: int | None) -> tuple[str, str]:
        """Ask for edits: the name of the message, and the message."""
        given = {"edits": list(edits)} | ({} if if_revision is None else {"if_revision": if_revision})
        return self._ask("edits", given)

    def reverse(self, what: str) -> tuple[str, str]:
        """Ask for `undo` or `redo`: the name of the message, and the message."""
        return self._ask(what, {})

    def _ask(self, type: str, given: Mapping[str, Any]) -> tuple[str, str]:
        name = next(self._names)
        return name, json.dumps({**given, "type": type, "id": name})

    def hear(self, message: str | bytes) -> None:
        """Take in what the service says."""
        if isinstance(message, bytes):
            if self._header is not None:
                self.frames.append(StreamFrame(**vars(_Header.of(self._header)), content=message))
                self._header = None
            return
        told = json.loads(message)
        match told["type"]:
            case "frame":
                self._header = told
            case "status":
                self.status = Status.of(told["status"])
            case "edited":
                self._answers[told["id"]] = Edited.of(told)
            case "error":
                self._hear_refusal(told["id"], told["problem"])

    def answer(self, name: str) -> Edited | None:
        """What a message was answered; None where nothing has come yet. Raises ProblemError."""
        found = self._answers.pop(name, None)
        if isinstance(found, ProblemError):
            raise found
        return found

    def next_frame(self) -> tuple[StreamFrame, str] | None:
        """The next frame, and what acknowledges it; None where there is none yet.

        Raises ProblemError where the view was refused.
        """
        if self._refusal is not None:
            refusal, self._refusal = self._refusal, None
            raise refusal
        if not self.frames:
            return None
        frame = self.frames.popleft()
        return frame, json.dumps({"type": "ack", "number": frame.number})

    def _hear_refusal(self, name: str | None, problem: Mapping[str, Any]) -> None:
        error = ProblemError.told(problem)
        if name is None or name == self._looking:
            self._refusal = error
        else:
            self._answers[name] = error


def address_of(base: str, path: str) -> str:
    """Where the stream of a session is, by the address of the service and the session's path."""
    return f"ws{base.removeprefix('http').rstrip('/')}{path}/stream"


def refusal_of(response: Any) -> ProblemError:
    """Why no stream was opened, as the service's answer to the handshake tells it."""
    try:
        told = json.loads(response.body or b"{}")
    except ValueError:
        told = {}
    return ProblemError.told({"status": response.status_code, "detail": response.reason_phrase, **told})
