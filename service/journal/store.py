"""The tables that sessions are kept in, and what is asked of them. SQLite, one connection, one thread."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_FORMAT: Final = 1
"""Of the tables and of the JSON in them"""

_APPLICATION: Final = 0x68616C66
"""Marks the file as this program's: "half" """

_TABLES: Final = """
CREATE TABLE sessions (
    id TEXT PRIMARY KEY, owner TEXT NOT NULL, name TEXT NOT NULL, revision INTEGER NOT NULL,
    settings BLOB NOT NULL, used REAL NOT NULL, snapshot BLOB NOT NULL
) WITHOUT ROWID;
CREATE TABLE steps (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    session TEXT NOT NULL REFERENCES sessions ON DELETE CASCADE, step BLOB NOT NULL
);
CREATE INDEX steps_of_session ON steps (session, number);
CREATE TABLE answers (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    session TEXT NOT NULL REFERENCES sessions ON DELETE CASCADE,
    key TEXT NOT NULL, digest BLOB NOT NULL, answer BLOB NOT NULL, UNIQUE (session, key)
);
"""

KEPT_ANSWERS: Final = 1000
"""Answers to requests with a key that are kept for each session, the newest ones"""


class JournalError(Exception):
    """What is kept could not be read or written."""

    retry_after: Final = 10


@dataclass(frozen=True)
class Kept:
    """A session, as the list of them tells it."""

    id: str
    owner: str
    name: str
    revision: int
    settings: bytes
    """JSON"""
    used: float
    """When anybody used it last, as far as is written; seconds since the epoch"""


@dataclass(frozen=True)
class Stands:
    """How a session stands after a step."""

    revision: int
    settings: bytes | None
    """JSON; None: as before"""
    used: float


@dataclass(frozen=True)
class Whole:
    """All that is kept of a session: JSON."""

    snapshot: bytes
    steps: tuple[bytes, ...]
    last: int
    """Number of the last of the steps; 0 without any"""


@dataclass(frozen=True)
class KeyedAnswer:
    """What a request with a key was answered with."""

    key: str
    digest: bytes
    """Of the request"""
    answer: bytes


class Store:
    """The tables. Every method may raise sqlite3.Error."""

    def __init__(self, file: Path | None) -> None:
        """Open `file`, or tables in memory; make what is missing. Raises JournalError."""
        self._tables = sqlite3.connect(
            ":memory:" if file is None else file, isolation_level=None, check_same_thread=False
        )
        self._tables.execute("PRAGMA journal_mode = WAL")
        # Of what was committed nothing may be lost, even where the power is.
        self._tables.execute("PRAGMA synchronous = FULL")
        self._tables.execute("PRAGMA foreign_keys = ON")
        (found,) = self._tables.execute("PRAGMA user_version").fetchone()
        if found == 0:
            self._tables.executescript(
                f"BEGIN; {_TABLES} PRAGMA user_version = {_FORMAT}; "
                f"PRAGMA application_id = {_APPLICATION}; COMMIT;"
            )
        elif found != _FORMAT:
            raise JournalError(f"its format is {found}, and this version reads {_FORMAT}")

    def close(self) -> None:
        """Write all into the one file, and close it."""
        self._tables.close()

    def execute(self, statement: str) -> None:
        """Begin, commit, roll back."""
        self._tables.execute(statement)

    def sessions(self) -> list[Kept]:
        """All that are kept."""
        rows = self._tables.execute("SELECT id, owner, name, revision, settings, used FROM sessions")
        return [Kept(*row) for row in rows]

    def begin(self, kept: Kept, snapshot: bytes) -> None:
        """Keep a session."""
        self._tables.execute(
            "INSERT INTO sessions (id, owner, name, revision, settings, used, snapshot) "
            "VALUES (?, ?, ?, ?, ?, ?, ?)",
            (kept.id, kept.owner, kept.name, kept.revision, kept.settings, kept.used, snapshot),
        )

    def append(self, session: str, step: bytes, stands: Stands, answer: KeyedAnswer | None = None) -> None:
        """Keep a step, and what it was answered with, if it may be asked for again."""
        self._tables.execute("INSERT INTO steps (session, step) VALUES (?, ?)", (session, step))
        self._tables.execute(
            "UPDATE sessions SET revision = ?, settings = coalesce(?, settings), used = ? WHERE id = ?",
            (stands.revision, stands.settings, stands.used, session),
        )
        if answer is None:
            return
        self._tables.execute(
            "INSERT INTO answers (session, key, digest, answer) VALUES (?, ?, ?, ?)",
            (session, answer.key, answer.digest, answer.answer),
        )
        self._tables.execute(
            "DELETE FROM answers WHERE session = ?1 AND number <= "
            "(SELECT number FROM answers WHERE session = ?1 ORDER BY number DESC LIMIT 1 OFFSET ?2)",
            (session, KEPT_ANSWERS),
        )

    def answer(self, session: str, key: str) -> KeyedAnswer | None:
        """What a request with that key was answered with."""
        row = self._tables.execute(
            "SELECT key, digest, answer FROM answers WHERE session = ? AND key = ?", (session, key)
        ).fetchone()
        return None if row is None else KeyedAnswer(*row)

    def whole(self, session: str) -> Whole:
        """All of a session. Raises JournalError where nothing is kept of it."""
        row = self._tables.execute("SELECT snapshot FROM sessions WHERE id = ?", (session,)).fetchone()
        if row is None:
            raise JournalError(f"nothing is kept of session {session}")
        steps = self._tables.execute(
            "SELECT number, step FROM steps WHERE session = ? ORDER BY number", (session,)
        ).fetchall()
        return Whole(row[0], tuple(step for _, step in steps), steps[-1][0] if steps else 0)

    def fold(self, session: str, snapshot: bytes, last: int) -> None:
        """Put a snapshot in the place of all steps up to number `last`, unless they are gone already."""
        folded = self._tables.execute(
            "UPDATE sessions SET snapshot = ?1 WHERE id = ?2 AND EXISTS "
            "(SELECT 1 FROM steps WHERE session = ?2 AND number = ?3)",
            (snapshot, session, last),
        )
        if folded.rowcount:
            self._tables.execute("DELETE FROM steps WHERE session = ? AND number <= ?", (session, last))

    def replace(self, kept: Kept, snapshot: bytes) -> None:
        """Keep a session anew, as another snapshot."""
        self._tables.execute(
            "UPDATE sessions SET name = ?, revision = ?, settings = ?, used = ?, snapshot = ? WHERE id = ?",
            (kept.name, kept.revision, kept.settings, kept.used, snapshot, kept.id),
        )
        self._tables.execute("DELETE FROM steps WHERE session = ?", (kept.id,))
        self._tables.execute("DELETE FROM answers WHERE session = ?", (kept.id,))

    def touch(self, session: str, used: float) -> None:
        """Somebody has used a session."""
        self._tables.execute("UPDATE sessions SET used = ? WHERE id = ?", (used, session))

    def forget(self, session: str) -> None:
        """Keep nothing of a session."""
        self._tables.execute("DELETE FROM sessions WHERE id = ?", (session,))
