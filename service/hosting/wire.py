"""Messages over a stream socket: four bytes of length, then a pickle.

Both ends are processes of one program and one user, joined by a socket pair: pickle is safe here.
"""

from __future__ import annotations

import asyncio
import pickle
import socket
import struct
import threading
from typing import Final, cast

from service.hosting.messages import FromWorker, ToWorker

_LENGTH: Final = struct.Struct("!I")


def _pack(message: object) -> bytes:
    body = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    return _LENGTH.pack(len(body)) + body


class WorkerEnd:
    """The worker's end: blocking; one thread reads, any may write."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self._reader = link.makefile("rb")
        self._writing = threading.Lock()

    def send(self, message: FromWorker) -> None:
        """Send a message. Raises OSError where the web process is gone."""
        packed = _pack(message)
        with self._writing:
            self._link.sendall(packed)

    def receive(self) -> ToWorker | None:
        """The next message; None where the web process is gone."""
        try:
            head = self._reader.read(_LENGTH.size)
            if len(head) < _LENGTH.size:
                return None
            (length,) = _LENGTH.unpack(head)
            body = self._reader.read(length)
        except OSError:
            return None
        return cast("ToWorker", pickle.loads(body)) if len(body) == length else None


class WebEnd:
    """The web process's end: asynchronous."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    @classmethod
    async def over(cls, link: socket.socket) -> WebEnd:
        """The end over one socket of a pair."""
        return cls(*await asyncio.open_connection(sock=link))

    async def send(self, message: ToWorker) -> None:
        """Send a message. Raises OSError where the worker is gone."""
        self._writer.write(_pack(message))
        await self._writer.drain()

    async def receive(self) -> FromWorker | None:
        """The next message; None where the worker is gone."""
        try:
            (length,) = _LENGTH.unpack(await self._reader.readexactly(_LENGTH.size))
            return cast("FromWorker", pickle.loads(await self._reader.readexactly(length)))
        except (asyncio.IncompleteReadError, OSError):
            return None

    def close(self) -> None:
        """Hang up: the worker ends."""
        self._writer.close()
