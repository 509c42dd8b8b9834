"""A page of memory that the web process and all workers see: by it, work on light gives way to what is asked.

The web process writes how many requests are being served that somebody waits for. Workers look before each
slice of work on light: while there are any they give way, for a while. And they take turns: each works only
with one of a few places, which it holds for a moment. A place is a byte of the page's file that is locked;
the kernel frees it with the process, however that ends.

(Priorities of the scheduler would be simpler, but a process that has given its own up may not have it back.)
"""

from __future__ import annotations

import asyncio
import fcntl
import mmap
import os
import struct
import time
from collections.abc import Callable
from typing import Final

_NUMBERS: Final = struct.Struct("=ii")
"""Urgent requests, and places"""

_PLACES_AT: Final = 64
"""Where in the file the places are"""

_SIZE: Final = mmap.PAGESIZE

_URGENT_FOR: Final = 0.1
"""Seconds for which a request is urgent; one that takes longer is work itself."""

_GIVES_WAY: Final = 0.03
"""Seconds for which a worker gives way after a slice, at most: it always gets on."""

_HOLDS: Final = 0.1
"""Seconds that a worker works before the next may"""

_LEAVES: Final = 0.004
"""Seconds in which another may take a place that was left"""

_LOOKS: Final = 0.002
"""Seconds between two looks"""


class Board:
    """The page, as the web process sees it."""

    def __init__(self, places: int) -> None:
        """Let `places` workers work on light at a time."""
        self._places = places
        self._file: int | None = None
        self._page: mmap.mmap | None = None
        self._urgent = 0

    @property
    def descriptor(self) -> int:
        """Of the file that workers are given."""
        if self._file is None:
            self._file = os.memfd_create("halflight-board", os.MFD_CLOEXEC)
            os.ftruncate(self._file, _SIZE)
            self._page = mmap.mmap(self._file, _SIZE)
            self._add(0)
        return self._file

    def urgent(self) -> Callable[[], None]:
        """Somebody waits for an answer, until what is returned is called; not for long, in any case."""
        self._add(1)
        left = False

        def leave() -> None:
            nonlocal left
            if not left:
                left = True
                timer.cancel()
                self._add(-1)

        timer = asyncio.get_running_loop().call_later(_URGENT_FOR, leave)
        return leave

    def close(self) -> None:
        """Let go of it. Workers that have it go on."""
        page, file = self._page, self._file
        self._page = self._file = None
        if page is not None:
            page.close()
        if file is not None:
            os.close(file)

    def _add(self, count: int) -> None:
        self._urgent += count
        if self._page is not None:
            _NUMBERS.pack_into(self._page, 0, self._urgent, self._places)


class Turn:
    """When one worker may work on its light."""

    def __init__(self, descriptor: int) -> None:
        """Take turns with all who have the board of that file descriptor."""
        self._file = descriptor
        self._page = mmap.mmap(descriptor, _SIZE, prot=mmap.PROT_READ)
        _, self._places = _NUMBERS.unpack_from(self._page)
        self._held: int | None = None
        self._since = self._ended = self._left = 0.0

    def delay(self) -> float:
        """Seconds until it is worth asking again whether it may work; 0 if it may, which takes a place."""
        now = time.monotonic()
        urgent, _ = _NUMBERS.unpack_from(self._page)
        if urgent > 0 and now - self._ended < _GIVES_WAY:
            return _LOOKS
        if self._held is None and (now - self._left < _LEAVES or not self._take(now)):
            return _LOOKS
        return 0.0

    def worked(self, more: bool) -> None:
        """A slice of work is done, and there may be more."""
        self._ended = time.monotonic()
        if self._held is not None and (not more or self._ended - self._since > _HOLDS):
            fcntl.lockf(self._file, fcntl.LOCK_UN, 1, _PLACES_AT + self._held)
            self._held, self._left = None, self._ended

    def _take(self, now: float) -> bool:
        for place in range(self._places):
            try:
                fcntl.lockf(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _PLACES_AT + place)
            except OSError:
                continue
            self._held, self._since = place, now
            return True
        return False
