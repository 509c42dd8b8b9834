"""Workers in stock, so that a session need not even wait for a fork and a GL context."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable

from service.hosting.board import Board
from service.hosting.nursery import Nursery
from service.hosting.remote import RemoteWorker, WorkerNotStartedError

_log = logging.getLogger(__name__)


class WorkerPool:
    """A few workers that hold no session yet, ready or about to be."""

    def __init__(self, nursery: Nursery, board: Board, size: int, on_lost: Callable[[], None]) -> None:
        """Keep `size` workers of `nursery`, which take turns by `board`.

        `on_lost` is called for each that ends unexpectedly.
        """
        self._nursery = nursery
        self._board = board
        self._size = size
        self._on_lost = on_lost
        self._stock: deque[asyncio.Future[RemoteWorker]] = deque()
        self._closed = False

    @property
    def stock(self) -> int:
        """Workers that wait for a session."""
        return sum(coming.done() and _failure(coming) is None for coming in self._stock)

    async def begin(self) -> None:
        """Start to fill the stock; return with the first worker. Raises WorkerNotStartedError."""
        self._fill()
        if self._stock:
            await asyncio.shield(self._stock[0])

    async def take(self) -> RemoteWorker:
        """The worker that is ready, or will be, first. Raises WorkerNotStartedError where none starts."""
        while self._stock:
            coming = self._stock.popleft()
            try:
                worker = await asyncio.shield(coming)
            except WorkerNotStartedError:
                continue
            except asyncio.CancelledError:
                self._stock.appendleft(coming)
                raise
            self._fill()
            if not worker.gone:
                return worker
            await worker.close()
        worker = await self._start()
        self._fill()
        return worker

    def give_back(self, worker: RemoteWorker) -> None:
        """Take back a worker that holds no session after all."""
        given: asyncio.Future[RemoteWorker] = asyncio.get_running_loop().create_future()
        given.set_result(worker)
        self._stock.appendleft(given)

    async def close(self) -> None:
        """End all that is in stock."""
        self._closed = True
        while self._stock:
            coming = self._stock.popleft()
            await asyncio.wait([coming])
            if _failure(coming) is None:
                await coming.result().close()
        self._board.close()

    async def _start(self) -> RemoteWorker:
        return await RemoteWorker.start(self._nursery, self._board, self._on_lost)

    def _fill(self) -> None:
        """Start as many workers as are missing."""
        while len(self._stock) < self._size and not self._closed:
            coming = asyncio.create_task(self._start())
            coming.add_done_callback(_tell_failure)
            self._stock.append(coming)


def _failure(coming: asyncio.Future[RemoteWorker]) -> BaseException | None:
    return asyncio.CancelledError() if coming.cancelled() else coming.exception()


def _tell_failure(coming: asyncio.Future[RemoteWorker]) -> None:
    """Whoever takes it is told by itself; where nobody does, this is all that tells it."""
    if isinstance(_failure(coming), WorkerNotStartedError):
        _log.error("a worker for the pool did not start")
