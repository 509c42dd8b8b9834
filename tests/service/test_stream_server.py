"""Streams over real sockets: clients that dawdle, and workers that die."""

from __future__ import annotations

import json
import os
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from tests.service.apps import Served, serving
from tests.service.processes import PATIENCE, eventually
from tests.service.streams import Viewer
from tests.service.test_server import ENDLESS, LOOSE, running

SIZE = {"width": 320, "height": 240}


@pytest.fixture(scope="module")
def service() -> Iterator[Served]:
    with serving(pool_size=1, max_message_bytes=100_000) as http:
        yield Served(http)


@dataclass(frozen=True)
class SocketLine:
    """A line to a service in another process."""

    socket: ClientConnection

    def send(self, text: str) -> None:
        self.socket.send(text)

    def receive(self) -> str | bytes:
        return self.socket.recv(timeout=PATIENCE)


@contextmanager
def streaming(service: Served, path: str) -> Iterator[Viewer]:
    url = f"ws{str(service.http.base_url).removeprefix('http')}{path}/stream"
    with connect(url, max_size=2**24) as line:
        yield Viewer(SocketLine(line))


def test_a_camera_that_moves_is_followed_and_ends_sharp(service: Served) -> None:
    path = service.open(LOOSE)
    with streaming(service, path) as viewer:
        viewer.say("camera", **SIZE)
        viewer.see_until_converged()
        # For as long as it takes a busy machine to draw some.
        moving, step, deadline = 0, 0, time.monotonic() + PATIENCE
        while moving < 3 and time.monotonic() < deadline:
            for _ in range(15):
                step += 1
                viewer.say("camera", id=str(step), eye=[0.02 * (step % 50), 0, 1.9], **SIZE)
                time.sleep(0.02)
            moving += viewer.see().header["quality"] == "moving"
        assert moving == 3
        last = viewer.see_until_converged()[-1].header
    assert last["quality"] == "rest"
    assert last["id"] == str(step)
    assert last["width"] == 320
    assert service.http.delete(path).status_code == 204


def test_a_client_that_stops_reading_slows_nobody(service: Served) -> None:
    path = service.open(ENDLESS)
    host, port = service.http.base_url.host, service.http.base_url.port
    assert port is not None
    # A client that says what it wants, acknowledges what it has not read, and never reads.
    with socket.create_connection((host, port)) as deaf, streaming(service, path) as keen:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.sendall(
            f"GET {path}/stream HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\n"
            "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
        )
        wanted = {"type": "camera", "format": "png", "width": 1600, "height": 1200}
        for message in (wanted, *({"type": "ping"} for _ in range(200))):
            text = json.dumps(message).encode()
            # Masked by zeros, as clients must mask.
            deaf.sendall(bytes([0x81, 0x80 | len(text)]) + b"\x00" * 4 + text)
        slowest = 0.0
        for revision in range(2, 22):
            edits = [{"op": "move", "id": "crate", "transform": {"translation": [0, 0, 0.05 * revision]}}]
            start = time.monotonic()
            keen.say("edits", edits=edits)
            assert keen.hear("edited")["revision"] == revision
            slowest = max(slowest, time.monotonic() - start)
        assert slowest < 5.0
    assert service.http.delete(path).status_code == 204


def test_what_is_too_big_or_to_no_session_is_refused(service: Served) -> None:
    with pytest.raises(InvalidStatus) as refused, streaming(service, "/v1/sessions/none"):
        pass
    assert refused.value.response.status_code == 404
    assert json.loads(refused.value.response.body or b"")["type"] == "urn:halflight:no-such-session"
    path = service.open(LOOSE)
    with streaming(service, path) as viewer:
        viewer.say_text("x" * 200_000)
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                viewer.see()
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1009
    assert service.http.delete(path).status_code == 204


@pytest.mark.slow
def test_the_end_of_the_service_ends_streams_at_once() -> None:
    with running() as service:
        path = service.open(ENDLESS)
        with streaming(service, path) as viewer:
            viewer.say("camera", **SIZE)
            viewer.see()
            os.kill(service.process.pid, signal.SIGTERM)
            with pytest.raises(ConnectionClosed):
                while True:
                    viewer.see()
        assert eventually(lambda: service.process.poll() is not None)
        assert service.process.stderr is not None
        assert service.process.stderr.read() == ""
