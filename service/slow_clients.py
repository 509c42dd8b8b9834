"""Clients that take their time: a request's head must have come soon, and its body at some pace.

Each holds a connection and what has come so far; without a bound, a few hundred that never finish would hold
the service up for nothing.
"""

from __future__ import annotations

import asyncio
import time
from typing import Any, Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from service.problems import TOO_SLOW, ProblemError

_TOO_LATE: Final = b"HTTP/1.1 408 Request Timeout\r\nconnection: close\r\ncontent-length: 0\r\n\r\n"


class BodyPace:
    """Refuses bodies that come too slowly."""

    def __init__(self, app: ASGIApp, seconds: float, rate: float) -> None:
        """A body may take `seconds`, and as many more as it takes at `rate` bytes a second."""
        self._app = app
        self._seconds = seconds
        self._rate = rate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        deadline = time.monotonic() + self._seconds
        complete = False

        async def timed() -> Message:
            nonlocal deadline, complete
            if complete:
                return await receive()  # which waits for the client to hang up
            try:
                async with asyncio.timeout(deadline - time.monotonic()):
                    message = await receive()
            except TimeoutError:
                what = f"the body comes more slowly than {self._rate:g} bytes a second"
                raise ProblemError(TOO_SLOW, what, headers={"Connection": "close"}) from None
            complete = not message.get("more_body", False)
            deadline += len(message.get("body", b"")) / self._rate
            return message

        await self._app(scope, timed, send)


class PatientProtocol(HttpToolsProtocol):
    """HTTP as uvicorn speaks it, but the head of a request must have come within `head_seconds`."""

    head_seconds = 10.0

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._head_due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client has connected: the first head is due."""
        super().connection_made(transport)
        self._await_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """The client has hung up."""
        self._has_head()
        super().connection_lost(exc)

    def on_message_begin(self) -> None:
        """A request begins."""
        super().on_message_begin()
        if self._head_due is None:
            self._await_head()

    def on_headers_complete(self) -> None:
        """All of the head has come."""
        self._has_head()
        super().on_headers_complete()

    def _await_head(self) -> None:
        self._head_due = self.loop.call_later(self.head_seconds, self._give_up)

    def _has_head(self) -> None:
        if self._head_due is not None:
            self._head_due.cancel()
            self._head_due = None

    def _give_up(self) -> None:
        self._head_due = None
        if not self.transport.is_closing():
            self.transport.write(_TOO_LATE)
            self.transport.close()


def patient(head_seconds: float) -> type[PatientProtocol]:
    """The protocol with that much patience: uvicorn makes one of it for each connection."""
    return type("PatientProtocol", (PatientProtocol,), {"head_seconds": head_seconds})
