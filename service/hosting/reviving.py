"""The processes that hold one session, one after another.

A process can be lost, or be put away while nobody needs it; the next one goes on from what is written of the
session. One that is lost is replaced at once, and who waits for an answer of it asks the next. Where one
after another is lost, the session's own scene may be the cause: then it has to wait.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import replace
from typing import Any, Final, TypeVar

from service.hosting.messages import GetExport, GetFrame, GetGrid, GetLightmap, GetOverlay, Open, Request
from service.hosting.remote import RemoteWorker, WorkerGoneError
from service.session_metrics import SessionMetrics
from solver.engine.status import EngineStatus

R = TypeVar("R")
T = TypeVar("T")

_log = logging.getLogger(__name__)

_CHANCES: Final = 3
"""Processes that one request is put to before it is given up: it may be what ends them."""

_MOST_LOSSES: Final = 5
"""Processes that a session may lose within `_CALM`"""

_CALM: Final = 60.0
"""Seconds"""


class StillWakingError(WorkerGoneError):
    """The session is being brought back, and the request could not wait for longer."""

    def __str__(self) -> str:
        return "the session is being brought back; try again"


class KeepsEndingError(WorkerGoneError):
    """The session's processes are lost one after another."""

    retry_after = round(_CALM)

    def __str__(self) -> str:
        return "the worker processes of this session end one after another; what it holds is kept, try later"


class Processes:
    """The process that holds a session, while it has one."""

    def __init__(
        self,
        load: Callable[[], Awaitable[Open]],
        take: Callable[[], Awaitable[RemoteWorker]],
        patience: float,
        metrics: SessionMetrics,
    ) -> None:
        """`load` tells what a process goes on from, `take` gives one that holds no session; both may raise
        what is to be told. `patience`: seconds that a request waits for the next process."""
        self._load = load
        self._take = take
        self._patience = patience
        self._metrics = metrics
        self._process: RemoteWorker | None = None
        self._waking: asyncio.Task[RemoteWorker] | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._losses: deque[float] = deque(maxlen=_MOST_LOSSES)
        self._news = asyncio.Event()
        self._ended = False
        self._failed = False

    @property
    def gone(self) -> bool:
        """Whether the session has ended for good, or cannot be brought back now."""
        return self._ended or self._failed

    @property
    def is_awake(self) -> bool:
        """Whether there is a process, or about to be one."""
        return not self._ended and (self._process is not None or self._is_waking)

    @property
    def current(self) -> RemoteWorker | None:
        """The process; None while there is none that lives."""
        return None if self._process is None or self._process.gone else self._process

    @property
    def status(self) -> EngineStatus | None:
        """The latest that a process has told of the session; None while it sleeps."""
        return None if self._process is None else self._process.status

    async def news(self) -> None:
        """Return when the status has changed, or the process."""
        await self._news.wait()

    def attach(self, process: RemoteWorker) -> None:
        """Go on in `process`, which holds the session."""
        self._process, self._failed = process, False
        self.later(self._watch(process))
        self._spread_news()

    def rouse(self) -> None:
        """Begin to wake where there is no process; nothing waits for it."""
        if self.current is None and not self._ended:
            with contextlib.suppress(KeepsEndingError):
                self._wake_up()

    async def put(self, request: Request[R]) -> tuple[R, RemoteWorker]:
        """The answer to `request`, and the process that gave it.

        Raises RefusedError, WorkerGoneError, and what `load` and `take` raise.
        """
        start = time.monotonic()
        for _ in range(_CHANCES - 1):
            process = await self._awake()
            with contextlib.suppress(WorkerGoneError):
                return await process.call(_hurried(request, time.monotonic() - start)), process
        process = await self._awake()
        return await process.call(_hurried(request, time.monotonic() - start)), process

    async def put_away(self) -> None:
        """End the process, if there is one."""
        process, self._process = self._process, None
        if process is not None:
            await process.close()
            self._spread_news()

    async def start_anew(self) -> None:
        """End the process, and one that is about to be, and begin to wake another."""
        await self._stop_waking()
        await self.put_away()
        self.rouse()

    async def end(self) -> None:
        """End for good."""
        self._ended = True
        await self._stop_waking()
        await self.put_away()
        self._spread_news()
        while self._tasks:
            await asyncio.wait(self._tasks)

    def later(self, work: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        """Do `work`, whoever stops to wait for it; `end` waits."""
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    @property
    def _is_waking(self) -> bool:
        return self._waking is not None and not self._waking.done()

    async def _awake(self) -> RemoteWorker:
        deadline = time.monotonic() + self._patience
        while (process := self.current) is None:
            if self._ended:
                raise WorkerGoneError
            waking = self._wake_up()
            done, _ = await asyncio.wait([waking], timeout=deadline - time.monotonic())
            if not done:
                raise StillWakingError
            if not waking.cancelled():
                return waking.result()
        return process

    def _wake_up(self) -> asyncio.Task[RemoteWorker]:
        """The task that brings back a process. Raises KeepsEndingError."""
        if self._waking is None or self._waking.done():
            now = time.monotonic()
            if len(self._losses) == _MOST_LOSSES and now - self._losses[0] < _CALM:
                self._failed = True
                self._spread_news()
                raise KeepsEndingError
            self._failed = False
            self._waking = asyncio.create_task(self._wake())
            self._waking.add_done_callback(self._tell_failure)
        return self._waking

    async def _wake(self) -> RemoteWorker:
        start = time.monotonic()
        await self.put_away()
        opening = await self._load()
        process = await self._opened(opening)
        self.attach(process)
        self._metrics.wakings.observe(time.monotonic() - start)
        return process

    async def _opened(self, opening: Open) -> RemoteWorker:
        """A process that holds what `opening` tells; another one, where one ends before it does."""
        for _ in range(_CHANCES - 1):
            with contextlib.suppress(WorkerGoneError):
                return await self._open_in(await self._take(), opening)
        return await self._open_in(await self._take(), opening)

    async def _open_in(self, process: RemoteWorker, opening: Open) -> RemoteWorker:
        try:
            await process.call(opening)
        except BaseException:
            await process.close()
            raise
        return process

    def _tell_failure(self, waking: asyncio.Task[RemoteWorker]) -> None:
        """Who waits is told by the task itself; where nobody does, this is all that tells it."""
        failure = None if waking.cancelled() else waking.exception()
        if failure is not None:
            self._failed = True
            _log.warning("a session could not be brought back: %s", failure)
            self._spread_news()

    async def _stop_waking(self) -> None:
        waking, self._waking = self._waking, None
        if waking is not None:
            waking.cancel()
            await asyncio.wait([waking])

    async def _watch(self, process: RemoteWorker) -> None:
        """Spread the news of a process, and see that the next one comes where it is lost."""
        while not process.gone:
            await process.news()
            self._spread_news()
        if self._process is process and not self._ended:
            self._losses.append(time.monotonic())
            self.rouse()

    def _spread_news(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()


def _hurried(request: Request[R], late: float) -> Request[R]:
    """`request` with less time to wait, by `late` seconds."""
    if isinstance(request, GetFrame | GetOverlay | GetLightmap | GetExport | GetGrid):
        return replace(request, timeout=max(0.0, request.timeout - late))  # type: ignore[return-value]
    return request
