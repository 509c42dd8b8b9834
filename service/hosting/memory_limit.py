"""How much memory a session may take: what its worker has beyond what it was forked with."""

from __future__ import annotations

import mmap
import re
import resource
import time
from pathlib import Path
from typing import Final

from service.hosting.spare_memory import give_back

_INTERVAL: Final = 0.2
"""Seconds between two looks"""

_ALLOWANCE: Final = 2
"""Where one step takes more than so many times the limit at once, the system refuses it;"""

_SPARE: Final = 1 << 30
"""and so many bytes besides, since libraries do not bear that as arrays do."""


class MemoryLimit:
    """Looks at the memory of this process."""

    def __init__(self, most_bytes: int) -> None:
        """It may take `most_bytes` more than it has now."""
        self._most_bytes = most_bytes
        self._most = _resident() + most_bytes
        self._due = 0.0
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        allowed = _data() + _ALLOWANCE * most_bytes + _SPARE
        soft = allowed if hard == resource.RLIM_INFINITY else min(allowed, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))

    def is_passed(self) -> bool:
        """Whether it has taken more; asked often, it looks now and then."""
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + _INTERVAL
        if _resident() <= self._most:
            return False
        give_back()
        return _resident() > self._most

    @property
    def reason(self) -> str:
        """What is told of a session that is paused for it."""
        return (
            f"The session has taken more memory than max_session_bytes ({self._most_bytes:,}) allows, and is "
            "paused. An edit or a change of settings lets it go on: fewer elements, or a larger "
            "error_tolerance, take less."
        )


def _resident() -> int:
    """Bytes of this process that are in memory, those shared with others included."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * mmap.PAGESIZE


def _data() -> int:
    """Bytes of this process that it may write to, whether they are in memory or not."""
    found = re.search(r"^VmData:\s+(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
    return 0 if found is None else 1024 * int(found[1])
