"""A worker process as the web process sees it: calls with answers, its latest status, its end."""

from __future__ import annotations

import asyncio
import itertools
import logging
import socket
from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

from service.hosting.board import Board
from service.hosting.messages import (
    Abandon,
    Answer,
    ApplyEdits,
    Call,
    GetFrame,
    GetPick,
    Probe,
    Ready,
    Redo,
    Refusal,
    Request,
    StatusChanged,
    Undo,
)
from service.hosting.nursery import DistantProcess, Nursery
from service.hosting.wire import WebEnd
from solver.engine.requests import WaitFor
from solver.engine.status import EngineStatus, SessionState

R = TypeVar("R")

_log = logging.getLogger(__name__)

_URGENT: Final = (ApplyEdits, GetPick, Probe, Redo, Undo)
"""Requests that somebody waits for, beside frames"""

_LAST_WORDS: Final = 1.0
"""Seconds within which the end of a worker is read, once it takes no more calls"""


class WorkerGoneError(Exception):
    """The worker has ended."""

    retry_after = 2

    def __init__(self) -> None:
        super().__init__("the worker process of this session has ended; nothing of the session is lost")


class WorkerNotStartedError(WorkerGoneError):
    """A worker has ended before it could take a session."""

    def __str__(self) -> str:
        return "a worker process could not be started; the service's own log says why"


class RefusedError(Exception):
    """A worker refused a request."""

    def __init__(self, refusal: Refusal) -> None:
        self.refusal = refusal
        super().__init__(refusal.detail)


class RemoteWorker:
    """One worker process, from its start to its end."""

    def __init__(
        self, process: DistantProcess, end: WebEnd, board: Board, on_lost: Callable[[], None]
    ) -> None:
        self._process = process
        self._board = board
        self._end = end
        self._on_lost = on_lost
        self._numbers = itertools.count(1)
        self._pending: dict[int, asyncio.Future[object]] = {}
        self._news = asyncio.Event()
        self._reading: asyncio.Task[None] | None = None
        self._closing = False
        self.status: EngineStatus | None = None
        """The latest that the worker has told of its session"""
        self.gone = False
        """Whether the worker has ended"""
        self.rendering_problem: str | None = None
        """Why it cannot draw frames, if it cannot"""

    @classmethod
    async def start(cls, nursery: Nursery, board: Board, on_lost: Callable[[], None]) -> RemoteWorker:
        """Have a process forked, and wait until it is ready. Raises WorkerNotStartedError where it is not.

        `on_lost` is called when the process ends without having been closed.
        """
        ours, theirs = socket.socketpair()
        try:
            process = await asyncio.to_thread(_born, nursery, theirs, board.descriptor)
        except OSError as error:
            ours.close()
            _log.error("a worker could not be started: %s", error)
            raise WorkerNotStartedError from error
        worker = cls(process, await WebEnd.over(ours), board, on_lost)
        try:
            ready = await worker._end.receive()
            if not isinstance(ready, Ready):
                raise WorkerNotStartedError
        except BaseException:
            await worker.close()
            raise
        worker.rendering_problem = ready.rendering_problem
        worker._reading = asyncio.create_task(worker._read())
        return worker

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    async def call(self, request: Request[R]) -> R:
        """The answer to `request`. Raises RefusedError, WorkerGoneError.

        A caller that is cancelled tells the worker not to bother.
        """
        if self.gone:
            raise WorkerGoneError
        number = next(self._numbers)
        answer = self._pending[number] = asyncio.get_running_loop().create_future()
        leave = self._board.urgent() if self._is_urgent(request) else None
        try:
            await self._tell(Call(number, request))
            value = await answer
        except asyncio.CancelledError:
            if not self.gone:
                await self._tell(Abandon(number))
            raise
        finally:
            self._pending.pop(number, None)
            if leave is not None:
                leave()
        if isinstance(value, Refusal):
            raise RefusedError(value)
        return cast("R", value)

    def _is_urgent(self, request: Request[Any]) -> bool:
        """Whether it is served at once, where others do not work."""
        if isinstance(request, GetFrame):
            at_rest = self.status is not None and self.status.state is not SessionState.SOLVING
            return at_rest or request.wait.until is WaitFor.NONE
        return isinstance(request, _URGENT)

    async def news(self) -> None:
        """Return when the status has changed, or the worker has ended."""
        await self._news.wait()

    async def close(self) -> None:
        """End the process, and wait until it has ended."""
        self._closing = True
        self._end.close()
        if self._reading is not None:
            await self._reading
        await asyncio.to_thread(self._process.end)

    async def _tell(self, message: Call | Abandon) -> None:
        try:
            await self._end.send(message)
        except OSError as lost:
            # Nobody is to call it again before it is known that it has ended.
            if self._reading is not None:
                await asyncio.wait([self._reading], timeout=_LAST_WORDS)
            raise WorkerGoneError from lost

    async def _read(self) -> None:
        while (message := await self._end.receive()) is not None:
            match message:
                case Answer(number, value):
                    answer = self._pending.get(number)
                    if answer is not None and not answer.done():
                        answer.set_result(value)
                case StatusChanged(status):
                    self.status = status
                    self._spread_news()
                case Ready():
                    pass
        self._lost()

    def _lost(self) -> None:
        self.gone = True
        if not self._closing:
            _log.error("worker %d has ended unexpectedly", self.pid)
            self._on_lost()
        for answer in self._pending.values():
            if not answer.done():
                answer.set_exception(WorkerGoneError())
        self._spread_news()

    def _spread_news(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()


def _born(nursery: Nursery, theirs: socket.socket, board: int) -> DistantProcess:
    with theirs:
        return nursery.worker(theirs, board)
