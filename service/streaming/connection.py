"""One client's stream: messages in, frames and status out, until either end has had enough.

Three tasks share the socket. One reads, and serves edits in the order in which they come; one sends frames;
one tells the status. Whichever ends first ends the others.
"""

from __future__ import annotations

import asyncio
from enum import IntEnum

from pydantic import BaseModel
from starlette.websockets import WebSocket, WebSocketDisconnect

from service.context import Context
from service.hosting.remote import WorkerGoneError
from service.hosting.sessions import NoSuchSessionError, Session
from service.problems import INVALID, TOLD, ProblemError
from service.routes.edits import apply_edits, redo_edits, undo_edits
from service.schemas import EditsAnswer, SessionStatus
from service.streaming.feed import Feed
from service.streaming.incoming import (
    SOURCE,
    AckMessage,
    CameraMessage,
    EditsMessage,
    Incoming,
    PingMessage,
    RedoMessage,
    UndoMessage,
    parse,
)
from service.streaming.outgoing import EditedMessage, ErrorMessage, Outbox, PongMessage, StatusMessage


class CloseCode(IntEnum):
    """Why the service closes a stream."""

    TOO_BIG = 1009
    IDLE = 4408
    """Nothing has come from the client for too long"""
    SESSION_ENDED = 4410
    WORKER_GONE = 4503


_REASONS = {
    CloseCode.TOO_BIG: "the message is larger than the limit",
    CloseCode.IDLE: "nothing has come for too long",
    CloseCode.SESSION_ENDED: "the session has ended",
    CloseCode.WORKER_GONE: "the session's worker is gone",
}


class _Enough(Exception):
    """The service closes the stream."""

    def __init__(self, code: CloseCode) -> None:
        self.code = code


class Connection:
    """A stream, once it is accepted."""

    def __init__(self, socket: WebSocket, session: Session, context: Context) -> None:
        self._socket = socket
        self._session = session
        self._context = context
        self._outbox = Outbox(socket)
        self._feed = Feed(session, self._outbox, context.metrics)

    async def serve(self) -> None:
        """Serve until the client hangs up, or close: see `CloseCode`."""
        tasks = [asyncio.create_task(work) for work in (self._read(), self._feed.run(), self._tell_status())]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)
        try:
            for task in done:
                task.result()
            await self._close(self._end())
        except _Enough as enough:
            await self._close(enough.code)
        except WorkerGoneError:
            await self._close(self._end())
        except WebSocketDisconnect:
            pass

    async def _close(self, code: CloseCode) -> None:
        await self._socket.close(code, _REASONS[code])

    def _end(self) -> CloseCode:
        """Why a session whose worker is gone is no more."""
        try:
            self._context.sessions.find(self._session.id)
        except NoSuchSessionError:
            return CloseCode.SESSION_ENDED
        return CloseCode.WORKER_GONE

    async def _tell_status(self) -> None:
        """Send the status when it changes; where the client is slow, the latest."""
        worker, told = self._session.worker, None
        while not worker.gone:
            if worker.status is not None and worker.status is not told:
                told = worker.status
                await self._outbox.tell(StatusMessage(status=SessionStatus.of(self._session.id, told)))
            else:
                await worker.news()

    async def _read(self) -> None:
        while True:
            text = await self._receive()
            if text is None:
                what = "messages are JSON texts; this one is binary"
                await self._refuse(None, ProblemError.of_field(INVALID, [SOURCE], what))
                continue
            name, message = parse(text)
            if isinstance(message, ProblemError):
                await self._refuse(name, message)
                continue
            try:
                reply = await self._serve(message)
            except WorkerGoneError:
                raise
            except TOLD as error:
                await self._refuse(name, ProblemError.of_error(error, SOURCE))
            else:
                if reply is not None:
                    await self._outbox.tell(reply)

    async def _receive(self) -> bytes | None:
        """The next message; None where it is no text. Raises WebSocketDisconnect, _Enough."""
        settings = self._context.settings
        try:
            async with asyncio.timeout(settings.stream_idle_seconds):
                message = await self._socket.receive()
        except TimeoutError:
            raise _Enough(CloseCode.IDLE) from None
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1005), message.get("reason"))
        text = message.get("text")
        size = len(message.get("bytes") or b"") if text is None else len(text)
        if size > settings.max_message_bytes:
            raise _Enough(CloseCode.TOO_BIG)
        return None if text is None else text.encode("utf-8", "surrogatepass")

    async def _refuse(self, name: str | None, problem: ProblemError) -> None:
        await self._outbox.tell(ErrorMessage(id=name, problem=problem.problem))

    async def _serve(self, message: Incoming) -> BaseModel | None:
        """What a message is answered with, if it is. Raises one of TOLD."""
        match message:
            case CameraMessage():
                self._feed.look(message)
                return None
            case AckMessage():
                self._feed.acknowledge(message.number)
                return None
            case PingMessage():
                return PongMessage(id=message.id)
            case EditsMessage():
                return _edited(message.id, await apply_edits(message, self._session, self._context))
            case UndoMessage():
                return _edited(message.id, await undo_edits(self._session))
            case RedoMessage():
                return _edited(message.id, await redo_edits(self._session))


def _edited(name: str | None, answer: EditsAnswer) -> EditedMessage:
    return EditedMessage(id=name, revision=answer.revision, changes=answer.changes)
