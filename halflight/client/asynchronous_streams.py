"""A session's stream for programs of asyncio: `Stream` with `await`."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from types import TracebackType
from typing import Any, Self

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

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
from halflight.client.streams import lost


class AsyncStream:
    """Views and edits to a session, and frames from it as they become better; opened by `async with`.

    Iterate over it for the frames, which end with the session. Every method may raise StreamLostError. One
    task at a time may use it.
    """

    def __init__(self, address: str, headers: Mapping[str, str], timeout: float) -> None:
        self._talk = Conversation()
        self._connecting = connect(
            address, additional_headers=headers, open_timeout=timeout, max_size=None, compression=None
        )
        self._line: ClientConnection | None = None

    async def __aenter__(self) -> Self:
        """Open it. Raises ProblemError where the service refuses, OSError where nobody answers."""
        try:
            self._line = await self._connecting.__aenter__()
        except InvalidStatus as refused:
            raise refusal_of(refused.response) from None
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Hang up; the session stays."""
        await self._connecting.__aexit__(None, None, None)

    @property
    def status(self) -> Status | None:
        """How the session stands, as far as was heard; None before anything was."""
        return self._talk.status

    async def look(self, camera: str | None = None, **query: Any) -> None:
        """Show this from now on: `eye=[1, 2, 3]`, `width`, `renderer`, `format` and so on, as in the docs."""
        await self._say(self._talk.look({"camera": camera, **query}))

    async def edit(self, *edits: Edit, if_revision: int | None = None) -> Edited:
        """Apply all of `edits`, or none. Raises ProblemError."""
        return await self._answer(*self._talk.edit(edits, if_revision))

    async def undo(self) -> Edited:
        """Take back the newest batch. Raises ProblemError."""
        return await self._answer(*self._talk.reverse("undo"))

    async def redo(self) -> Edited:
        """Bring back the batch that was taken back last. Raises ProblemError."""
        return await self._answer(*self._talk.reverse("redo"))

    def __aiter__(self) -> AsyncIterator[StreamFrame]:
        return self

    async def __anext__(self) -> StreamFrame:
        """The next frame. Raises ProblemError where the view is refused."""
        while (found := self._talk.next_frame()) is None:
            try:
                await self._hear()
            except StreamLostError as ended:
                if ended.code in ENDED:
                    raise StopAsyncIteration from None
                raise
        frame, acknowledgement = found
        await self._say(acknowledgement)
        return frame

    @property
    def _open(self) -> ClientConnection:
        if self._line is None:
            raise RuntimeError("a stream is opened by `async with`")
        return self._line

    async def _answer(self, name: str, message: str) -> Edited:
        await self._say(message)
        while (found := self._talk.answer(name)) is None:
            await self._hear()
        return found

    async def _say(self, message: str) -> None:
        try:
            await self._open.send(message)
        except ConnectionClosed as closed:
            raise lost(closed) from None

    async def _hear(self) -> None:
        try:
            async with asyncio.timeout(IDLE):
                message = await self._open.recv()
        except TimeoutError:
            await self._say(PING)
        except ConnectionClosed as closed:
            raise lost(closed) from None
        else:
            self._talk.hear(message)
