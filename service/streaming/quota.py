"""How many streams there may be: of a session, and in all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final


class TooManyStreamsError(Exception):
    """All the streams that may be are."""

    retry_after: Final = 10

    def __init__(self, limit: int, what: str) -> None:
        self.limit = limit
        super().__init__(f"{what} has {limit} streams already, and may have no more; close one first")


class StreamQuota:
    """Counts streams, WebSockets and events alike."""

    def __init__(self, of_session: int, in_all: int) -> None:
        self._of_session = of_session
        self._in_all = in_all
        self._open: Counter[str] = Counter()

    @contextmanager
    def taken(self, session: str) -> Iterator[None]:
        """While inside, a session has one stream more. Raises TooManyStreamsError."""
        if self._open[session] >= self._of_session:
            raise TooManyStreamsError(self._of_session, "the session")
        if self._open.total() >= self._in_all:
            raise TooManyStreamsError(self._in_all, "the service")
        self._open[session] += 1
        try:
            yield
        finally:
            self._open[session] -= 1
            if not self._open[session]:
                del self._open[session]
