"""The journal: one thread that writes, and whoever waits until what was written is safe.

What is asked while a transaction is being written to the disk goes into the next one, all together: a
disk that needs ten milliseconds to make anything safe does not hold up a hundred edits for a second.
Each request is a savepoint of its own, so that one that fails takes no other with it.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
import queue
import sqlite3
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from service.journal.store import JournalError, Store

T = TypeVar("T")

_FILE: Final = "sessions.sqlite3"
_LOCK: Final = "lock"

_TOGETHER: Final = 64
"""Requests of one transaction, at most"""


@dataclass(frozen=True, eq=False)
class _Job:
    work: Callable[[Store], Any]
    done: asyncio.Future[Any]
    loop: asyncio.AbstractEventLoop


class Journal:
    """What is kept of all sessions, in a directory that no other service has, or in memory."""

    def __init__(self, directory: Path | None, on_commit: Callable[[float], None] | None = None) -> None:
        """`on_commit` is told the seconds that each transaction took, in the journal's thread."""
        self._directory = directory
        self._on_commit = on_commit
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._store: Store | None = None
        self._thread: threading.Thread | None = None
        self._lock: int | None = None

    def open(self) -> bool:
        """Open it, and start its thread; False where it is open. Raises JournalError."""
        if self._thread is not None:
            return False
        try:
            self._store = Store(None if self._directory is None else self._locked(self._directory))
        except (OSError, sqlite3.Error) as error:
            self._unlock()
            raise JournalError(f"sessions cannot be kept in {self._directory}: {error}") from error
        except JournalError as error:
            self._unlock()
            raise JournalError(f"sessions cannot be kept in {self._directory}: {error}") from None
        self._thread = threading.Thread(target=self._run, args=(self._store,), name="halflight-journal")
        self._thread.start()
        return True

    async def run(self, work: Callable[[Store], T]) -> T:
        """What `work` returns, once all that it wrote is safe. Raises JournalError."""
        if self._thread is None:
            raise JournalError("the journal is closed")
        loop = asyncio.get_running_loop()
        done: asyncio.Future[T] = loop.create_future()
        self._jobs.put(_Job(work, done, loop))
        return await done

    async def close(self) -> None:
        """Do what was asked, then close it."""
        thread, self._thread = self._thread, None
        if thread is not None:
            self._jobs.put(None)
            await asyncio.to_thread(thread.join)
        self._unlock()

    def _locked(self, directory: Path) -> Path:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._lock = os.open(directory / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise JournalError("another service has it") from None
        return directory / _FILE

    def _unlock(self) -> None:
        lock, self._lock = self._lock, None
        if lock is not None:
            os.close(lock)

    def _run(self, store: Store) -> None:
        ending = False
        while not ending:
            jobs = [self._jobs.get()]
            with contextlib.suppress(queue.Empty):
                while len(jobs) < _TOGETHER:
                    jobs.append(self._jobs.get_nowait())
            ending = None in jobs
            self._commit(store, [job for job in jobs if job is not None])
        store.close()

    def _commit(self, store: Store, jobs: list[_Job]) -> None:
        if not jobs:
            return
        start = time.perf_counter()
        try:
            store.execute("BEGIN IMMEDIATE")
            outcomes = [_outcome(store, job.work) for job in jobs]
            store.execute("COMMIT")
        except sqlite3.Error as error:
            with contextlib.suppress(sqlite3.Error):
                store.execute("ROLLBACK")
            outcomes = [JournalError(str(error)) for _ in jobs]
        if self._on_commit is not None:
            self._on_commit(time.perf_counter() - start)
        for job, outcome in zip(jobs, outcomes, strict=True):
            # A loop that has ended has nobody who waits.
            with contextlib.suppress(RuntimeError):
                job.loop.call_soon_threadsafe(_settle, job.done, outcome)


def _outcome(store: Store, work: Callable[[Store], object]) -> object:
    """What `work` returns, or the error that undid what it wrote."""
    store.execute("SAVEPOINT job")
    try:
        outcome = work(store)
    except (JournalError, sqlite3.Error) as error:
        store.execute("ROLLBACK TO job")
        outcome = error if isinstance(error, JournalError) else JournalError(str(error))
    store.execute("RELEASE job")
    return outcome


def _settle(done: asyncio.Future[Any], outcome: object) -> None:
    if done.done():
        return
    if isinstance(outcome, JournalError):
        done.set_exception(outcome)
    else:
        done.set_result(outcome)
