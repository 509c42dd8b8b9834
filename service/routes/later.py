"""Calls that the contract names and this version does not do yet: each says so."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Path, WebSocket

from service.context import Context, session_of
from service.hosting.sessions import NoSuchSessionError
from service.problems import NO_SUCH_SESSION, NOT_AVAILABLE, ProblemError, respond

router = APIRouter(prefix="/v1", include_in_schema=False)
sockets = APIRouter(prefix="/v1")
_of_session = [Depends(session_of)]


@router.get("/sessions/{id}/stream", dependencies=_of_session)
async def not_yet() -> None:
    """Say that this is still to come."""
    raise ProblemError(NOT_AVAILABLE, "this call is part of the interface, and not available yet")


@sockets.websocket("/sessions/{id}/stream")
async def no_stream_yet(socket: WebSocket, session_id: Annotated[str, Path(alias="id")]) -> None:
    """Say so to who wants a stream."""
    context: Context = socket.app.state.context
    try:
        context.sessions.find(session_id)
    except NoSuchSessionError as error:
        await socket.send_denial_response(respond(NO_SUCH_SESSION, str(error)))
    else:
        await socket.send_denial_response(respond(NOT_AVAILABLE, "the stream is not available yet"))
