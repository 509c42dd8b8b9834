"""Request bodies: of bounded size, JSON and nothing else, parsed without a way into the interpreter's limits.

Numbers that are not finite parse here, so that the model can name the field that holds one.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from pydantic_core import from_json
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.problems import INVALID, LIMIT, UNSUPPORTED_MEDIA, ProblemError, respond


class BodyLimit:
    """Refuses bodies over a limit as soon as the limit is passed, be it by what the head declares."""

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        declared = dict(scope["headers"]).get(b"content-length", b"0")
        if declared.isdigit() and int(declared) > self._max_bytes:
            await self._refusal()(scope, receive, send)
            return
        seen = 0

        async def counted() -> Message:
            nonlocal seen
            message = await receive()
            if message["type"] == "http.request":
                seen += len(message.get("body", b""))
                if seen > self._max_bytes:
                    raise ProblemError(LIMIT, self._detail)
            return message

        await self._app(scope, counted, send)

    @property
    def _detail(self) -> str:
        return f"the body is larger than the limit of {self._max_bytes} bytes"

    def _refusal(self) -> Response:
        return respond(LIMIT, self._detail, headers={"Connection": "close"})


class JsonRequest(Request):
    """A request whose body must be JSON."""

    async def json(self) -> Any:
        """The parsed body. Raises ProblemError."""
        try:
            return from_json(await self.body(), allow_inf_nan=True)
        except ValueError as error:
            raise ProblemError.of_field(INVALID, ["body"], f"not acceptable JSON: {error}") from None


class JsonRoute(APIRoute):
    """A route whose body, if it has one, is parsed by JsonRequest."""

    def get_route_handler(self) -> Callable[[Request], Awaitable[Response]]:
        """The handler that FastAPI calls."""
        handle = super().get_route_handler()

        async def handle_json(request: Request) -> Response:
            parsed = JsonRequest(request.scope, request.receive)
            if self.body_field is not None and await parsed.body():
                _require_json(request.headers.get("content-type", ""))
            return await handle(parsed)

        return handle_json


def _require_json(content_type: str) -> None:
    # A page of another origin can post forms and plain text unasked, but not JSON.
    media_type = content_type.partition(";")[0].strip().lower()
    if media_type != "application/json":
        raise ProblemError(UNSUPPORTED_MEDIA, "the body must be sent as Content-Type: application/json")
