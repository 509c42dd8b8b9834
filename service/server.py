"""Serving the app: the socket, the address that is told, and an end that leaves nothing behind."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import sys
from typing import Final

import uvicorn
from fastapi import FastAPI

from service import logs
from service.app import create_app
from service.config import ServiceSettings
from service.context import Context
from service.hosting.nursery import Nursery
from service.refused_sockets import SocketProtocol
from service.slow_clients import patient

_GRACE: Final = 5
"""Seconds that requests are given to end when the server does."""


_KEPT: Final = 75
"""Seconds that a connection may rest between two requests: longer than clients keep theirs, lest one be hung
up while a request is on its way"""


class Server(uvicorn.Server):
    """A server that tells its address when it is ready, and ends its sessions before it waits for requests.

    Streams of events and frames that wait end with their session, so that they don't hold up the end.
    """

    def __init__(self, app: FastAPI, address: str) -> None:
        self._context = _context(app)
        super().__init__(
            uvicorn.Config(
                app,
                log_level="warning",
                access_log=False,
                timeout_graceful_shutdown=_GRACE,
                timeout_keep_alive=_KEPT,
                http=patient(self._context.settings.head_seconds),
                ws=SocketProtocol,
                ws_max_size=self._context.settings.max_message_bytes,
                ws_per_message_deflate=False,  # frames are compressed already
            )
        )
        self._address = address

    async def run_on(self, listening: socket.socket) -> None:
        """Serve on a socket, once a worker is warm. Raises WorkerNotStartedError, JournalError."""
        await self._context.begin()
        try:
            await self.serve([listening])
        finally:
            await self._context.end()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start to serve, and say so."""
        await super().startup(sockets)
        if self.started:
            sys.stdout.write(f"halflight is ready at {self._address}\n")
            sys.stdout.flush()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End all sessions, then stop to serve."""
        await self._context.sessions.close()
        await super().shutdown(sockets)


def serve(settings: ServiceSettings | None = None) -> None:
    """Serve until interrupted or terminated.

    Raises OSError where the address cannot be taken, WorkerNotStartedError where nothing can be solved here,
    JournalError where sessions cannot be kept.
    """
    chosen = settings or ServiceSettings()
    logs.configure(chosen.log)
    nursery = Nursery()
    nursery.fork()  # before there are threads or sockets
    try:
        with _listen(chosen.host, chosen.port) as listening:
            server = Server(create_app(chosen, nursery), _address(listening))
            # Having shut down, uvicorn raises the signal again: an interrupt arrives here as this exception.
            with contextlib.suppress(KeyboardInterrupt):
                asyncio.run(server.run_on(listening))
    finally:
        nursery.close()


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.create_server((host, port), family=family, backlog=2048)
    # Accepted sockets inherit it: without, the body of a frame waits 40 ms for its head to be acknowledged.
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listening


def _address(listening: socket.socket) -> str:
    host, port = listening.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def _context(app: FastAPI) -> Context:
    context = app.state.context
    if not isinstance(context, Context):
        raise TypeError("the app was not made by create_app")
    return context


if __name__ == "__main__":
    serve()
