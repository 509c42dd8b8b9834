"""The files of sessions' light, beside the journal: where they are, and how much of the disk they may take.

Light can be solved anew from what the journal has, so that nothing here need be safe: what cannot be read, or
is one too many, is let go.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection
from pathlib import Path
from typing import Final

from service.hosting.light_keeping import LightPlace

_FOLDER: Final = "light"
_SUFFIX: Final = ".light"


class Lights:
    """The files, one for each session that has one."""

    def __init__(self, directory: Path | None, most_bytes: int, most_bytes_together: int) -> None:
        """Keep them in `directory`, if there is one: of no more bytes than that each, and all together."""
        self._folder = None if directory is None or most_bytes == 0 else directory / _FOLDER
        self._most = most_bytes
        self._most_together = most_bytes_together

    def place(self, session: str) -> LightPlace | None:
        """Where the light of a session is kept; None where none is."""
        if self._folder is None:
            return None
        return LightPlace((self._folder / session).with_suffix(_SUFFIX), self._most)

    def forget(self, session: str) -> None:
        """Keep nothing of a session whose worker has ended."""
        place = self.place(session)
        if place is not None:
            with contextlib.suppress(OSError):
                place.file.unlink()

    def tidy(self, sessions: Collection[str]) -> None:
        """Keep what is of `sessions` alone, and of that the newest, as much as there is room for."""
        if self._folder is None:
            return
        left = self._most_together
        for file, size in _newest_first(self._folder):
            if file.stem in sessions and size <= left:
                left -= size
                continue
            with contextlib.suppress(OSError):
                file.unlink()


def _newest_first(folder: Path) -> list[tuple[Path, int]]:
    found = []
    for file in folder.glob("*"):
        with contextlib.suppress(FileNotFoundError):
            told = file.stat()
            found.append((told.st_mtime, file, told.st_size))
    return [(file, size) for _, file, size in sorted(found, reverse=True)]
