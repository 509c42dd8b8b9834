"""Apps in this process. Their workers come from one nursery, so that each need not load all anew."""

from __future__ import annotations

import asyncio
import queue
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import httpx
from fastapi import FastAPI
from fastapi.testclient import TestClient

from service.app import create_app
from service.config import ServiceSettings
from service.hosting.nursery import Nursery
from service.server import Server
from tests.engine.scenes import box_document
from tests.service.processes import PATIENCE

NURSERY = Nursery()


def _app(settings: dict[str, Any]) -> FastAPI:
    return create_app(ServiceSettings.model_validate({"token": None} | settings), NURSERY)


def app_client(**settings: Any) -> TestClient:
    """The client of a new app; as a context, it begins and ends the app's life."""
    return TestClient(_app(settings))


@dataclass(frozen=True)
class Served:
    """A service, and a client of it."""

    http: httpx.Client

    def open(self, settings: dict[str, Any]) -> str:
        """The path of a new session on the box."""
        answer = self.http.post("/v1/sessions", json={"scene": box_document(), "settings": settings})
        assert answer.status_code == 201, answer.text
        return str(answer.headers["location"])


@contextmanager
def serving(**settings: Any) -> Iterator[httpx.Client]:
    """A client of a new app that a thread serves on a real socket."""
    app = _app({"pool_size": 0, **settings})
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        address = f"http://127.0.0.1:{listening.getsockname()[1]}"
        servers: queue.SimpleQueue[Server] = queue.SimpleQueue()

        def serve() -> None:
            server = Server(app, address)
            servers.put(server)
            asyncio.run(server.run_on(listening))

        thread = threading.Thread(target=serve)
        thread.start()
        server = servers.get()
        try:
            with httpx.Client(base_url=address, timeout=PATIENCE) as http:
                yield http
        finally:
            server.should_exit = True
            thread.join(PATIENCE)
            assert not thread.is_alive()
