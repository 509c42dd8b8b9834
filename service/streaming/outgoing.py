"""What the service says on a stream: JSON objects, told apart by their `type`, and the bytes of frames."""

from __future__ import annotations

import asyncio
from typing import Literal

from pydantic import BaseModel, Field
from starlette.websockets import WebSocket

from service.problems import Problem
from service.schemas import EditsAnswer, SessionStatus
from service.streaming.pacing import Quality
from solver.engine.requests import LayerName, RendererName


class FrameHeader(BaseModel):
    """Told right before the bytes of a frame, which are the next message and the only binary ones."""

    type: Literal["frame"] = "frame"
    number: int = Field(description="Counts the frames of this connection, from 1; to be acknowledged.")
    id: str | None = Field(description="Of the camera message that asked for it.")
    revision: int
    error_estimate: float
    converged: bool
    renderer: RendererName
    layer: LayerName
    media_type: str
    width: int
    height: int
    quality: Quality
    bytes: int
    render_ms: float = Field(description="What drawing it took, without encoding.")
    scale_maximum: float | None = Field(description="Of false colours: lux at the end of the scale.")


class StatusMessage(BaseModel):
    """The session stands otherwise than before."""

    type: Literal["status"] = "status"
    status: SessionStatus


class EditedMessage(EditsAnswer):
    """The answer to `edits`, `undo` and `redo`."""

    type: Literal["edited"] = "edited"
    id: str | None


class ErrorMessage(BaseModel):
    """A message was refused, and has changed nothing."""

    type: Literal["error"] = "error"
    id: str | None = Field(description="Of the message, as far as it could be read.")
    problem: Problem


class PongMessage(BaseModel):
    """The answer to `ping`."""

    type: Literal["pong"] = "pong"
    id: str | None


class Outbox:
    """Sends messages of several tasks over one socket, each whole."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._sending = asyncio.Lock()

    async def tell(self, message: BaseModel) -> None:
        """Send a message; returns when the connection has room for more. Raises WebSocketDisconnect."""
        text = message.model_dump_json()
        async with self._sending:
            await self._socket.send_text(text)

    async def show(self, header: FrameHeader, content: bytes) -> None:
        """Send a frame: its header, then its bytes. Raises WebSocketDisconnect."""
        text = header.model_dump_json()
        async with self._sending:
            await self._socket.send_text(text)
            await self._socket.send_bytes(content)
