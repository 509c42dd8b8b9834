"""Calls that the contract names and this version does not do yet: each says so."""

from __future__ import annotations

from typing import NoReturn

from fastapi import APIRouter, WebSocket

from service.context import UsedSession
from service.problems import NOT_AVAILABLE, ProblemError, respond

router = APIRouter(include_in_schema=False)


@router.post("/sessions/{id}/undo")
@router.post("/sessions/{id}/redo")
@router.get("/sessions/{id}/log")
@router.get("/sessions/{id}/pick")
@router.get("/sessions/{id}/stream")
async def not_yet(session: UsedSession) -> NoReturn:
    """Say that this is still to come."""
    raise ProblemError(NOT_AVAILABLE, "this call is part of the interface, and not available yet")


@router.websocket("/sessions/{id}/stream")
async def no_stream_yet(socket: WebSocket) -> None:
    """Say so to who wants a stream."""
    await socket.send_denial_response(respond(NOT_AVAILABLE, "the stream is not available yet"))
