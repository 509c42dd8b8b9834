"""Zip archives of a scene file and what it names, taken apart in memory and with bounds.

Nothing is written to a disk. Names that lead out of the archive are refused, and so is what grows beyond
a limit on being unpacked, whatever the archive says of its size.
"""

from __future__ import annotations

import io
import posixpath
import zipfile
import zlib
from collections.abc import Iterable
from typing import Final

from solver.errors import LimitExceededError, SceneError
from solver.formats.source import SourceFile

_MOST_FILES: Final = 256
_METHODS: Final = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
_PIECE: Final = 2**16

_FAILURES: Final = (
    zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, OSError, EOFError, ValueError, RuntimeError,
    NotImplementedError, OverflowError, LookupError,
)  # fmt: skip
"""What the library raises over archives that are damaged, or of kinds that it does not know."""


def unpack(content: bytes, suffixes: Iterable[str], most_bytes: int) -> SourceFile:
    """The one file with one of `suffixes` in an archive, with all others beside it.

    Raises SceneError, LimitExceededError where it unpacks to more than `most_bytes`.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            files = _files(archive, most_bytes)
    except _FAILURES as refused:
        raise SceneError(f"the archive cannot be unpacked ({type(refused).__name__})", ("archive",)) from None
    wanted = tuple(suffixes)
    main = [name for name in files if name.lower().endswith(wanted)]
    if len(main) != 1:
        found = "none" if not main else ", ".join(main[:5])[:200]
        raise SceneError(f"one file of {' '.join(wanted)} must be in it, and there is {found}", ("archive",))
    folder = posixpath.dirname(main[0])
    beside = {posixpath.relpath(name, folder or "."): data for name, data in files.items()}
    return SourceFile(posixpath.basename(main[0]), files[main[0]], beside)


def _files(archive: zipfile.ZipFile, most_bytes: int) -> dict[str, bytes]:
    """All files by their names."""
    entries = [entry for entry in archive.infolist() if not entry.is_dir()]
    if len(entries) > _MOST_FILES:
        raise LimitExceededError("files in the archive", len(entries), _MOST_FILES)
    files: dict[str, bytes] = {}
    room = most_bytes
    for number, entry in enumerate(entries):
        name = _safe(entry.filename, number)
        if name in files:
            raise SceneError(f"{name[:80]!r} is in it twice", ("archive", number))
        if entry.flag_bits & 1 or entry.compress_type not in _METHODS:
            raise SceneError("it is encrypted, or packed otherwise than by deflate", ("archive", number))
        files[name] = _read(archive, entry, room, most_bytes)
        room -= len(files[name])
    return files


def _read(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, room: int, most_bytes: int) -> bytes:
    """The bytes of a file, piece by piece, so that no more than the limit is ever held."""
    pieces, size = [], 0
    with archive.open(entry) as packed:
        while piece := packed.read(_PIECE):
            size += len(piece)
            if size > room:
                raise LimitExceededError("unpacked bytes", most_bytes - room + size, most_bytes)
            pieces.append(piece)
    return b"".join(pieces)


def _safe(name: str, number: int) -> str:
    """A name that stays within the archive."""
    plain = posixpath.normpath(name.replace("\\", "/"))
    is_outside = plain.startswith(("/", "../")) or plain == ".." or ":" in plain.split("/")[0]
    if is_outside or not name.isprintable():
        raise SceneError(f"{name[:80]!a} leads out of the archive", ("archive", number))
    return plain
