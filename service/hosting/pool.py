"""Warm workers in stock, so that a session need not wait for imports, kernels and a GL context."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable

from service.hosting.remote import RemoteWorker, WorkerNotStartedError

_log = logging.getLogger(__name__)


class WorkerPool:
    """A few workers that hold no session yet."""

    def __init__(self, size: int, refill_delay: float, on_lost: Callable[[], None]) -> None:
        """Keep `size` workers; refill `refill_delay` seconds after one was taken, so as not to take the
        cores from the session that took it. `on_lost` is called for each that ends unexpectedly."""
        self._size = size
        self._on_lost = on_lost
        self._delay = refill_delay
        self._stock: deque[RemoteWorker] = deque()
        self._refilling: asyncio.Task[None] | None = None
        self._closed = False

    @property
    def stock(self) -> int:
        """Workers that wait for a session."""
        return len(self._stock)

    async def begin(self) -> None:
        """Start the first worker, and the others in the background. Raises WorkerNotStartedError."""
        if self._size > 0 and not self._stock:
            self._stock.append(await RemoteWorker.start(self._on_lost))
            self._refill_later()

    async def fill(self) -> None:
        """Start workers until the stock is complete. Raises WorkerNotStartedError."""
        while len(self._stock) < self._size and not self._closed:
            self._stock.append(await RemoteWorker.start(self._on_lost))

    async def take(self) -> RemoteWorker:
        """A worker, warm from the stock or newly started. Raises WorkerNotStartedError where none starts."""
        self._refill_later()
        while self._stock:
            worker = self._stock.popleft()
            if not worker.gone:
                return worker
            await worker.close()
        return await RemoteWorker.start(self._on_lost)

    def give_back(self, worker: RemoteWorker) -> None:
        """Take back a worker that holds no session after all."""
        self._stock.appendleft(worker)

    async def close(self) -> None:
        """End all that is in stock."""
        self._closed = True
        if self._refilling is not None:
            self._refilling.cancel()
            await asyncio.gather(self._refilling, return_exceptions=True)
        while self._stock:
            await self._stock.popleft().close()

    def _refill_later(self) -> None:
        if self._size > 0 and (self._refilling is None or self._refilling.done()):
            self._refilling = asyncio.create_task(self._refill())

    async def _refill(self) -> None:
        await asyncio.sleep(self._delay)
        try:
            await self.fill()
        except WorkerNotStartedError:
            _log.error("a worker for the pool did not start")
