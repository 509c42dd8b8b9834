"""A session's stream for programs that block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from types import TracebackType
from typing import Any, Self

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from halflight.client.answers import Edited, Status
from halflight.client.conversation import (
    ENDED,
    IDLE,
    PING,
    Conversation,
    StreamFrame,
    StreamLostError,
    refusal_of,
)
from halflight.client.edits import Edit


class Stream:
    """Views and edits to a session, and frames from it as they become better.

    Iterate over it for the frames, which end with the session. Every method may raise StreamLostError.
    """

    def __init__(self, address: str, headers: Mapping[str, str], timeout: float) -> None:
        """Open it. Raises ProblemError where the service refuses, OSError where nobody answers."""
        self._talk = Conversation()
        self._open = ExitStack()
        try:
            self._line: ClientConnection = self._open.enter_context(
                connect(
                    address, additional_headers=headers, open_timeout=timeout, max_size=None, compression=None
                )
            )
        except InvalidStatus as refused:
            raise refusal_of(refused.response) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Hang up; the session stays."""
        self._open.close()

    @property
    def status(self) -> Status | None:
        """How the session stands, as far as was heard; None before anything was."""
        return self._talk.status

    def look(self, camera: str | None = None, **query: Any) -> None:
        """Show this from now on: `eye=[1, 2, 3]`, `width`, `renderer`, `format` and so on, as in the docs."""
        self._say(self._talk.look({"camera": camera, **query}))

    def edit(self, *edits: Edit, if_revision: int | None = None) -> Edited:
        """Apply all of `edits`, or none. Raises ProblemError."""
        return self._answer(*self._talk.edit(edits, if_revision))

    def undo(self) -> Edited:
        """Take back the newest batch. Raises ProblemError."""
        return self._answer(*self._talk.reverse("undo"))

    def redo(self) -> Edited:
        """Bring back the batch that was taken back last. Raises ProblemError."""
        return self._answer(*self._talk.reverse("redo"))

    def __iter__(self) -> Iterator[StreamFrame]:
        return self

    def __next__(self) -> StreamFrame:
        """The next frame. Raises ProblemError where the view is refused."""
        while (found := self._talk.next_frame()) is None:
            try:
                self._hear()
            except StreamLostError as ended:
                if ended.code in ENDED:
                    raise StopIteration from None
                raise
        frame, acknowledgement = found
        self._say(acknowledgement)
        return frame

    def _answer(self, name: str, message: str) -> Edited:
        self._say(message)
        while (found := self._talk.answer(name)) is None:
            self._hear()
        return found

    def _say(self, message: str) -> None:
        try:
            self._line.send(message)
        except ConnectionClosed as closed:
            raise lost(closed) from None

    def _hear(self) -> None:
        try:
            self._talk.hear(self._line.recv(timeout=IDLE))
        except TimeoutError:
            self._say(PING)
        except ConnectionClosed as closed:
            raise lost(closed) from None


def lost(closed: ConnectionClosed) -> StreamLostError:
    """How the end of a connection is told."""
    told = closed.rcvd
    return StreamLostError(1006, "") if told is None else StreamLostError(told.code, told.reason)
