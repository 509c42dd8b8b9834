"""A client of streams, for tests: what it sends, and what it waits for."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from fastapi.testclient import TestClient
from PIL import Image
from starlette.testclient import WebSocketTestSession

from solver.types import AnyArray


class Line(Protocol):
    """The far end of a WebSocket."""

    def send(self, text: str) -> None: ...

    def receive(self) -> str | bytes: ...


@dataclass(frozen=True)
class Received:
    """A frame."""

    header: dict[str, Any]
    content: bytes

    @property
    def pixels(self) -> AnyArray:
        """(height, width, 3) sRGB."""
        return np.asarray(Image.open(io.BytesIO(self.content)).convert("RGB"))


class Viewer:
    """One end of a stream."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self.statuses: list[dict[str, Any]] = []

    def say(self, kind: str, **fields: Any) -> None:
        """Send a message."""
        self._line.send(json.dumps({"type": kind, **fields}))

    def say_text(self, text: str) -> None:
        """Send what may be no message."""
        self._line.send(text)

    def hear(self, kind: str) -> dict[str, Any]:
        """The next message of a kind; status is kept, frames are acknowledged and left out."""
        while True:
            message = self._next()
            if isinstance(message, Received):
                self.acknowledge(message)
            elif message["type"] == kind:
                return message
            else:
                assert message["type"] in {"status", "pong"}, message

    def see(self, acknowledged: bool = True) -> Received:
        """The next frame."""
        while True:
            message = self._next()
            if isinstance(message, Received):
                if acknowledged:
                    self.acknowledge(message)
                return message
            assert message["type"] != "error", message

    def see_until_converged(self) -> list[Received]:
        """Frames up to the one that is converged."""
        frames = [self.see()]
        while not frames[-1].header["converged"]:
            frames.append(self.see())
        return frames

    def acknowledge(self, frame: Received) -> None:
        """Make room for the next frame."""
        self.say("ack", number=frame.header["number"])

    def nothing_more(self) -> bool:
        """Whether no frame comes before the answer to a ping that is sent now."""
        self.say("ping", id="nothing more")
        while True:
            message = self._next()
            if isinstance(message, Received):
                return False
            if message["type"] == "pong":
                return True

    def _next(self) -> dict[str, Any] | Received:
        received = self._line.receive()
        assert isinstance(received, str), "bytes come after their header only"
        message: dict[str, Any] = json.loads(received)
        if message["type"] == "status":
            self.statuses.append(message["status"])
        if message["type"] != "frame":
            return message
        content = self._line.receive()
        assert isinstance(content, bytes)
        assert len(content) == message["bytes"]
        return Received(message, content)


@dataclass(frozen=True)
class TestLine:
    """A line to a service in this process."""

    __test__ = False

    socket: WebSocketTestSession

    def send(self, text: str) -> None:
        self.socket.send_text(text)

    def receive(self) -> str | bytes:
        message = self.socket.receive()
        self.socket._raise_on_close(message)
        content: str | bytes = message["text"] if message.get("text") is not None else message["bytes"]
        return content


@contextmanager
def viewing(client: TestClient, path: str, **headers: str) -> Iterator[Viewer]:
    """A stream of a session."""
    with client.websocket_connect(f"{path}/stream", headers=headers) as socket:
        yield Viewer(TestLine(socket))
