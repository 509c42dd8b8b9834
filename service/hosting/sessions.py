"""The sessions that the service keeps: made, found, counted, put to sleep, woken, ended."""

from __future__ import annotations

import asyncio
import hashlib
import logging
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Final

from service.hosting.keeping import settings_text
from service.hosting.lasting import LastingWorker, Terms
from service.hosting.messages import GetStatus, Open
from service.hosting.pool import WorkerPool
from service.hosting.remote import RefusedError, RemoteWorker
from service.journal.documents import Snapshot, text_of
from service.journal.journal import Journal
from service.journal.lights import Lights
from service.journal.recollection import snapshot_of
from service.journal.store import JournalError, Kept
from service.session_metrics import SessionMetrics
from solver.document.settings import SettingsDocument
from solver.engine.past import Past
from solver.engine.status import EngineStatus, SessionState

_LONGEST_NAP: Final = 30.0
"""Seconds between two looks for idle sessions, at most."""

_DOZING: Final = 5.0
"""Seconds without use after which a session may be put to sleep to make room for another"""

_log = logging.getLogger(__name__)


class NoSuchSessionError(Exception):
    """No session has that id, or none that the client may know of."""

    def __init__(self, session_id: str) -> None:
        self.session_id = session_id
        super().__init__(f"there is no session {session_id!r}")


class TooManySessionsError(Exception):
    """All the sessions that may be at once are."""

    retry_after: Final = 10

    def __init__(self, limit: int, what: str = "in use") -> None:
        self.limit = limit
        super().__init__(f"all {limit} sessions are {what}; delete one first, or try later")


@dataclass(frozen=True)
class Quotas:
    """How many sessions may be, and how long."""

    awake: int
    """Sessions that have a process"""
    kept: int
    """Sessions in all"""
    idle_seconds: float
    """Without use, until a session is put to sleep"""
    expire_seconds: float
    """Without use, until a session is ended for good"""


class Session:
    """A worker under the name that clients call it by."""

    def __init__(self, kept: Kept, worker: LastingWorker) -> None:
        self.id = kept.id
        self.owner = kept.owner
        """Whose it is: "" where nobody was asked"""
        self.name = kept.name
        """Of its scene"""
        self.worker = worker
        self._users = 0
        self._last_used = time.monotonic() - max(0.0, time.time() - kept.used)
        self._revision = kept.revision
        self._settings = SettingsDocument.model_validate_json(kept.settings)

    @contextmanager
    def in_use(self) -> Iterator[Session]:
        """While inside, the session is awake, or is being woken."""
        self._users += 1
        self.worker.rouse()
        try:
            yield self
        finally:
            self._users -= 1
            self._last_used = time.monotonic()
            self._note()

    @property
    def idle_seconds(self) -> float:
        """Seconds since anybody used it."""
        return 0.0 if self._users else time.monotonic() - self._last_used

    @property
    def revision(self) -> int:
        """The latest that is known."""
        return self._revision

    @property
    def settings(self) -> SettingsDocument:
        """The latest that are known."""
        return self._settings

    async def restore(self, snapshot: Snapshot) -> None:
        """Be what `snapshot` tells from now on. Raises JournalError."""
        await self.worker.restore(snapshot, snapshot.scene.name)
        self.name = snapshot.scene.name

    def _note(self) -> None:
        status = self.worker.status
        if status is not None:
            self._revision = status.revision
            self._settings = SettingsDocument.describing(status.settings)


class Sessions:
    """All sessions of the service."""

    def __init__(
        self,
        pool: WorkerPool,
        journal: Journal,
        lights: Lights,
        quotas: Quotas,
        terms: Terms,
        metrics: SessionMetrics,
    ) -> None:
        self._pool = pool
        self._journal = journal
        self._lights = lights
        self._quotas = quotas
        self._terms = terms
        self._metrics = metrics
        self._by_id: dict[str, Session] = {}
        self._opening = 0
        self._making_room = asyncio.Lock()
        self._names: dict[str, asyncio.Lock] = {}
        """Of sessions that are being opened by a key"""

    def __len__(self) -> int:
        return len(self._by_id)

    def __iter__(self) -> Iterator[Session]:
        return iter(tuple(self._by_id.values()))

    async def load(self) -> None:
        """Take in all sessions that are kept; they sleep. Raises JournalError."""
        for kept in await self._journal.run(lambda store: store.sessions()):
            self._by_id[kept.id] = Session(kept, self._worker(kept.id))
        await asyncio.to_thread(self._lights.tidy, set(self._by_id))

    def find(self, session_id: str, owner: str | None = None) -> Session:
        """The session of that id, if it is that owner's, or anybody's where that is None.

        Raises NoSuchSessionError.
        """
        found = self._by_id.get(session_id)
        if found is None or owner not in (None, found.owner):
            raise NoSuchSessionError(session_id)
        return found

    async def open(
        self, request: Open, owner: str = "", key: str | None = None
    ) -> tuple[Session, EngineStatus]:
        """A new session, solving and written, and how it stands; by a `key`, the same for the same request.

        Raises TooManySessionsError, RefusedError, WorkerGoneError, JournalError.
        """
        snapshot = await asyncio.to_thread(_snapshot_text, request)
        if key is None:
            return await self._open_counted(request, snapshot, secrets.token_hex(8), owner)
        # The name follows from the request, so that it is known after a restart too.
        told = b"\0".join((owner.encode(), key.encode(), snapshot))
        name = hashlib.blake2b(told, digest_size=8).hexdigest()
        async with self._names.setdefault(name, asyncio.Lock()):
            try:
                found = self._by_id.get(name)
                if found is None:
                    return await self._open_counted(request, snapshot, name, owner)
                return found, await found.worker.call(GetStatus())
            finally:
                self._names.pop(name, None)

    async def _open_counted(
        self, request: Open, snapshot: bytes, name: str, owner: str
    ) -> tuple[Session, EngineStatus]:
        if len(self._by_id) + self._opening >= self._quotas.kept:
            raise TooManySessionsError(self._quotas.kept, "kept")
        self._opening += 1
        try:
            return await self._open(request, snapshot, name, owner)
        finally:
            self._opening -= 1

    async def _open(
        self, request: Open, snapshot: bytes, name: str, owner: str
    ) -> tuple[Session, EngineStatus]:
        await self._make_room()
        process = await self._pool.take()
        try:
            status = await process.call(replace(request, light=self._lights.place(name)))
            settings = settings_text(status.settings)
            kept = Kept(name, owner, status.name, status.revision, settings, time.time())
            await self._journal.run(lambda store: store.begin(kept, snapshot))
        except RefusedError:
            self._pool.give_back(process)
            raise
        except BaseException:
            await process.close()
            raise
        session = Session(kept, self._worker(kept.id))
        session.worker.attach(process)
        self._by_id[session.id] = session
        return session, status

    async def end(self, session_id: str, owner: str | None = None) -> None:
        """End a session and free all that it holds. Raises NoSuchSessionError, JournalError."""
        session = self.find(session_id, owner)
        await self._journal.run(lambda store: store.forget(session_id))
        self._by_id.pop(session_id, None)
        await session.worker.end()
        await asyncio.to_thread(self._lights.forget, session_id)

    async def tidy_forever(self) -> None:
        """Put sessions to sleep, and end them, as they become idle for too long."""
        quotas = self._quotas
        while True:
            await asyncio.sleep(min(_LONGEST_NAP, 0.25 * quotas.idle_seconds, 0.25 * quotas.expire_seconds))
            for session in self:
                try:
                    await self._tidy(session)
                except (JournalError, NoSuchSessionError) as failure:
                    _log.warning("session %s could not be tidied: %s", session.id, failure)
            await asyncio.to_thread(self._lights.tidy, set(self._by_id))

    async def close(self) -> None:
        """End all processes; what is kept stays."""
        await asyncio.gather(*(session.worker.end() for session in self))

    def count_by_state(self) -> dict[str, int]:
        """Sessions of each state, sleeping ones among them."""
        counted = dict.fromkeys([*SessionState, "asleep"], 0)
        for session in self:
            status = session.worker.status
            counted["asleep" if status is None else status.state] += 1
        return counted

    async def _tidy(self, session: Session) -> None:
        idle = session.idle_seconds
        if idle > self._quotas.expire_seconds:
            await self.end(session.id)
        elif idle > self._quotas.idle_seconds and session.worker.is_awake:
            await session.worker.sleep()

    def _worker(self, session_id: str) -> LastingWorker:
        async def take() -> RemoteWorker:
            await self._make_room(session_id)
            return await self._pool.take()

        light = self._lights.place(session_id)
        return LastingWorker(session_id, self._journal, take, self._terms, self._metrics, light)

    async def _make_room(self, session_id: str | None = None) -> None:
        """See that one more session may be awake: that one, or a new one. Raises TooManySessionsError."""
        async with self._making_room:
            others = [s for s in self if s.worker.is_awake and s.id != session_id]
            if len(others) + (self._opening if session_id else self._opening - 1) < self._quotas.awake:
                return
            dozing = [s for s in others if s.idle_seconds > _DOZING]
            if not dozing:
                raise TooManySessionsError(self._quotas.awake)
            await max(dozing, key=_dispensable).worker.sleep()


def _dispensable(session: Session) -> tuple[bool, float]:
    """More for who is to sleep first: who solves nothing, and was not used for long."""
    status = session.worker.status
    return status is None or status.state is not SessionState.SOLVING, session.idle_seconds


def _snapshot_text(request: Open) -> bytes:
    past = request.scene if isinstance(request.scene, Past) else Past(request.scene)
    return text_of(snapshot_of(past, request.settings))
