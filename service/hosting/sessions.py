"""The sessions that the service holds: made, found, counted, ended, and expired when idle."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from service.hosting.messages import Open
from service.hosting.pool import WorkerPool
from service.hosting.remote import RefusedError, RemoteWorker
from solver.engine.status import EngineStatus

_LONGEST_NAP: Final = 30.0
"""Seconds between two looks for idle sessions, at most."""


class NoSuchSessionError(Exception):
    """No session has that id."""

    def __init__(self, session_id: str) -> None:
        self.session_id = session_id
        super().__init__(f"there is no session {session_id!r}")


class TooManySessionsError(Exception):
    """All the sessions that may be held are."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        super().__init__(f"all {limit} sessions are in use; delete one first")


class Session:
    """A worker under the name that clients call it by."""

    def __init__(self, session_id: str, worker: RemoteWorker) -> None:
        self.id = session_id
        self.worker = worker
        self._users = 0
        self._last_used = time.monotonic()

    @contextmanager
    def in_use(self) -> Iterator[Session]:
        """While inside, the session does not expire."""
        self._users += 1
        try:
            yield self
        finally:
            self._users -= 1
            self._last_used = time.monotonic()

    @property
    def idle_seconds(self) -> float:
        """Seconds since anybody used it."""
        return 0.0 if self._users else time.monotonic() - self._last_used


class Sessions:
    """All sessions of the service."""

    def __init__(self, pool: WorkerPool, limit: int, idle_seconds: float) -> None:
        self._pool = pool
        self._limit = limit
        self._idle_seconds = idle_seconds
        self._by_id: dict[str, Session] = {}
        self._opening = 0

    def __len__(self) -> int:
        return len(self._by_id)

    def __iter__(self) -> Iterator[Session]:
        return iter(tuple(self._by_id.values()))

    def find(self, session_id: str) -> Session:
        """The session of that id. Raises NoSuchSessionError."""
        found = self._by_id.get(session_id)
        if found is None:
            raise NoSuchSessionError(session_id)
        return found

    async def open(self, request: Open) -> tuple[Session, EngineStatus]:
        """A new session, solving, and how it stands.

        Raises TooManySessionsError, RefusedError, WorkerGoneError.
        """
        if len(self._by_id) + self._opening >= self._limit:
            raise TooManySessionsError(self._limit)
        self._opening += 1
        try:
            worker = await self._pool.take()
            try:
                status = await worker.call(request)
            except RefusedError:
                self._pool.give_back(worker)
                raise
            except BaseException:
                await worker.close()
                raise
        finally:
            self._opening -= 1
        session = Session(secrets.token_hex(8), worker)
        self._by_id[session.id] = session
        return session, status

    async def end(self, session_id: str) -> None:
        """End a session and free all that it holds. Raises NoSuchSessionError."""
        session = self.find(session_id)
        del self._by_id[session_id]
        await session.worker.close()

    async def expire_forever(self) -> None:
        """End sessions as they become idle for too long."""
        while True:
            await asyncio.sleep(min(_LONGEST_NAP, 0.25 * self._idle_seconds))
            for session in self:
                # While one was ended, a client may have ended the next.
                if session.id in self._by_id and session.idle_seconds > self._idle_seconds:
                    await self.end(session.id)

    async def close(self) -> None:
        """End all sessions."""
        await asyncio.gather(*(self.end(session.id) for session in self))
