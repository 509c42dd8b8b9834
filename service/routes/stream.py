"""The stream of a session: who may have one, and that it takes a WebSocket."""

from __future__ import annotations

import base64
import binascii
from contextlib import ExitStack
from typing import Annotated, Final
from urllib.parse import urlsplit

from fastapi import APIRouter, Depends, Path, WebSocket

from service.context import Context, session_of
from service.hosting.sessions import Session
from service.ownership import owner_of
from service.problems import FORBIDDEN, TOLD, UPGRADE, ProblemError, respond
from service.streaming.connection import Connection

PROTOCOL: Final = "halflight.v1"
"""The subprotocol, which a client need not name"""

_BEARER: Final = "bearer."
"""Before a token, in base64url, among the subprotocols that a browser offers: it can set no header."""

router = APIRouter(prefix="/v1", include_in_schema=False)
sockets = APIRouter(prefix="/v1")


@router.get("/sessions/{id}/stream", dependencies=[Depends(session_of)])
async def no_socket() -> None:
    """Say that a stream takes a WebSocket."""
    headers = {"Upgrade": "websocket", "Connection": "Upgrade"}
    raise ProblemError(UPGRADE, "the stream is a WebSocket: see docs/streaming.md", headers=headers)


@sockets.websocket("/sessions/{id}/stream")
async def session_stream(socket: WebSocket, session_id: Annotated[str, Path(alias="id")]) -> None:
    """Cameras and edits in, frames out as they improve."""
    context: Context = socket.app.state.context
    taken = ExitStack()
    try:
        session = _admitted(socket, session_id, context)
        taken.enter_context(context.streams.taken(session.id))
    except TOLD as error:
        told = ProblemError.of_error(error, "header")
        await socket.send_denial_response(respond(told.kind, str(told.detail), told.errors, told.headers))
        return
    offered = socket.scope.get("subprotocols", [])
    with taken, session.in_use(), context.metrics.stream_clients.track_inprogress():
        await socket.accept(PROTOCOL if PROTOCOL in offered else None)
        await Connection(socket, session, context).serve()


def _admitted(socket: WebSocket, session_id: str, context: Context) -> Session:
    """The session that a stream is asked of. Raises one of TOLD where it may not be had."""
    # Browsers let any page open a socket to any host, but say which page it is.
    origin = socket.headers.get("origin")
    if origin is not None and urlsplit(origin).netloc != socket.headers.get("host"):
        raise ProblemError(FORBIDDEN, "pages of other origins may not open streams")
    owner = owner_of(
        _token(socket), context.settings, ", or offer the subprotocol bearer.<token in base64url>"
    )
    return context.sessions.find(session_id, owner)


def _token(socket: WebSocket) -> bytes:
    """The token that a client shows; empty where it shows none."""
    scheme, _, token = socket.headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return token.strip().encode()
    for offered in socket.scope.get("subprotocols", []):
        if offered.startswith(_BEARER):
            try:
                text = offered.removeprefix(_BEARER)
                return base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))
            except (binascii.Error, ValueError):
                return b""
    return b""
