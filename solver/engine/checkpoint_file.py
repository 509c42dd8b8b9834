"""Checkpoints as files: a header of JSON, the arrays one after the other, and a digest of it all.

Only what this very version of the solver wrote is read: the header has a digest of its source. A file holds
arrays of numbers alone, so that a bad one can be no worse than wrong, and the digest tells that.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Callable, Iterator
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Final

import numpy as np

from solver.engine.checkpoint import Checkpoint
from solver.errors import SolverError

_MAGIC: Final = b"halflight light\n"
_LENGTH: Final = struct.Struct("<Q")
_DIGEST: Final = 32
"""Bytes"""

_PIECE: Final = 1 << 20
"""Bytes that are written and digested at one go, without holding the interpreter meanwhile"""


class CheckpointError(SolverError):
    """A file that is no checkpoint, or not a whole one."""


class StaleCheckpointError(CheckpointError):
    """A checkpoint of another version of the solver."""

    def __init__(self) -> None:
        super().__init__("it is of another version")


def write_checkpoint(checkpoint: Checkpoint, file: Path, is_wanted: Callable[[], bool]) -> bool:
    """Write `file` whole or not at all; False where it was not wanted any more before it was done.

    So the arrays may be overwritten meanwhile, if `is_wanted` tells so before. Raises OSError.
    """
    part = file.with_suffix(".part")
    digest = hashlib.blake2b(digest_size=_DIGEST)
    try:
        with part.open("wb") as out:
            for piece in _pieces(checkpoint):
                if not is_wanted():
                    return False
                digest.update(piece)
                out.write(piece)
            out.write(digest.digest())
        if not is_wanted():
            return False
        part.replace(file)
        return True
    finally:
        part.unlink(missing_ok=True)


def read_checkpoint(file: Path) -> Checkpoint:
    """The checkpoint in `file`. Raises OSError, CheckpointError."""
    content = np.fromfile(file, np.uint8)
    held, told = content[:-_DIGEST], content[-_DIGEST:].tobytes()
    start = len(_MAGIC) + _LENGTH.size
    if held[: len(_MAGIC)].tobytes() != _MAGIC:
        raise CheckpointError("it is no checkpoint")
    if hashlib.blake2b(held.data, digest_size=_DIGEST).digest() != told:
        raise CheckpointError("it is damaged")
    (length,) = _LENGTH.unpack(held[len(_MAGIC) : start].tobytes())
    header = json.loads(held[start : start + length].tobytes())
    if header["stamp"] != source_stamp():
        raise StaleCheckpointError
    at = start + length
    arrays = {}
    for name, kind, shape in header["arrays"]:
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        arrays[name] = held[at : at + size].copy().view(kind).reshape(shape)
        at += size
    return Checkpoint(header["name"], header["numbers"], arrays)


def _pieces(checkpoint: Checkpoint) -> Iterator[bytes | memoryview]:
    """The content of a file but its digest."""
    arrays = {name: np.ascontiguousarray(array) for name, array in checkpoint.arrays.items()}
    header = {
        "stamp": source_stamp(),
        "name": checkpoint.name,
        "numbers": dict(checkpoint.numbers),
        "arrays": [(name, array.dtype.str, array.shape) for name, array in arrays.items()],
    }
    text = json.dumps(header).encode()
    yield _MAGIC + _LENGTH.pack(len(text)) + text
    for array in arrays.values():
        octets = array.reshape(-1).view(np.uint8).data
        for start in range(0, len(octets), _PIECE):
            yield octets[start : start + _PIECE]


@cache
def source_stamp() -> str:
    """A digest of the source of the solver: the light of another one may be another, or held otherwise."""
    digest = hashlib.blake2b(np.__version__.encode(), digest_size=16)
    for text in _sources(resources.files("solver")):
        digest.update(text)
    return digest.hexdigest()


def _sources(folder: Traversable) -> Iterator[bytes]:
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if entry.is_dir():
            yield from _sources(entry)
        elif entry.name.endswith((".py", ".glsl")):
            yield entry.name.encode() + entry.read_bytes()
