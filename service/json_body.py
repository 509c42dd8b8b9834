"""Request bodies: of bounded size, in JSON and nothing else.

Numbers that are not finite parse here, so that the model can name the field that holds one. A name that
occurs twice in an object is refused: which of the two was meant, nobody can tell.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Coroutine
from typing import Any, Final

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.problems import INVALID, LIMIT, UNSUPPORTED_MEDIA, ProblemError, respond

_SURROGATE: Final = re.compile(rb"\\u[dD][89a-fA-F]")
"""An escape that is half of a character, and needs its other half to be one."""


class BodyLimit:
    """Refuses bodies over a limit as soon as the limit is passed, be it by what the head declares."""

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
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
            return parse_json(await self.body())
        except ValueError as error:
            raise ProblemError.of_field(INVALID, ["body"], f"not acceptable JSON: {error}") from None


def parse_json(text: bytes) -> Any:
    """What `text` says. Raises ValueError, whose message is fit for a client."""
    try:
        value = json.loads(text.decode("utf-8"), object_pairs_hook=_members, parse_int=_integer)
        if _SURROGATE.search(text):
            json.dumps(value, ensure_ascii=False).encode("utf-8")
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except UnicodeDecodeError:
        raise ValueError("it is not encoded in UTF-8") from None
    except UnicodeEncodeError:
        raise ValueError("an escape stands for half a character") from None
    return value


def _members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        twice = next(name for name, count in Counter(name for name, _ in pairs).items() if count > 1)
        raise ValueError(f"{twice[:80]!r} occurs twice in an object")
    return members


def _integer(digits: str) -> int | float:
    """Beyond what a float holds exactly, and so any field of a document, a number is a float."""
    return int(digits) if len(digits) < 20 else float(digits)


class JsonRoute(APIRoute):
    """A route whose body, if it has one, is parsed by JsonRequest."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler that FastAPI calls."""
        handle = super().get_route_handler()

        async def handle_json(request: Request) -> Response:
            return await handle(await self.parsed(request))

        return handle_json

    async def parsed(self, request: Request) -> Request:
        """The request as FastAPI is to see it. Raises ProblemError."""
        parsed = JsonRequest(request.scope, request.receive)
        if self.body_field is not None and await parsed.body():
            _require_json(request.headers.get("content-type", ""))
        return parsed


def _require_json(content_type: str) -> None:
    # A page of another origin can post forms and plain text unasked, but not JSON.
    media_type = content_type.partition(";")[0].strip().lower()
    if media_type != "application/json":
        raise ProblemError(UNSUPPORTED_MEDIA, "the body must be sent as Content-Type: application/json")
