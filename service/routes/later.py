"""Calls that the contract names and this version does not do yet: each says so."""

from __future__ import annotations

from fastapi import APIRouter, Depends, WebSocket

from service.context import session_of
from service.problems import NOT_AVAILABLE, ProblemError, respond

router = APIRouter(prefix="/v1", include_in_schema=False)
sockets = APIRouter(prefix="/v1")
_of_session = [Depends(session_of)]


@router.post("/sessions/{id}/undo", dependencies=_of_session)
@router.post("/sessions/{id}/redo", dependencies=_of_session)
@router.get("/sessions/{id}/log", dependencies=_of_session)
@router.get("/sessions/{id}/pick", dependencies=_of_session)
@router.get("/sessions/{id}/stream", dependencies=_of_session)
async def not_yet() -> None:
    """Say that this is still to come."""
    raise ProblemError(NOT_AVAILABLE, "this call is part of the interface, and not available yet")


@sockets.websocket("/sessions/{id}/stream")
async def no_stream_yet(socket: WebSocket) -> None:
    """Say so to who wants a stream."""
    await socket.send_denial_response(respond(NOT_AVAILABLE, "the stream is not available yet"))
