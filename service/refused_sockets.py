"""WebSockets as uvicorn speaks them, but a client that is refused one is no error of the service."""

from __future__ import annotations

from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol


class SocketProtocol(WebSocketsSansIOProtocol):
    """What is answered in place of a handshake is an answer, of which the service's own log tells."""

    async def run_asgi(self) -> None:
        """Serve one connection."""
        app: Any = self.app

        async def answered(*of: Any) -> None:
            await app(*of)
            if self.initial_response is not None:
                # Else uvicorn, which only knows handshakes, logs that there was none.
                self.handshake_complete = True

        self.app = answered
        await super().run_asgi()
