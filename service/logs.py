"""What the service logs: a line for each request, and what happens to sessions and workers, as text or JSON.

Every answer names its request in `X-Request-Id`, the client's own name where it gave one, and every line that
is logged while a request is served names it too.
"""

from __future__ import annotations

import json
import logging
import re
import secrets
import time
from contextvars import ContextVar
from enum import StrEnum
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_log = logging.getLogger(__name__)

_request: ContextVar[str | None] = ContextVar("request", default=None)

_NAME: Final = re.compile(r"[\w.:-]{1,100}", re.ASCII)
"""A client's own name of a request; another is not taken over"""

_TOLD: Final = ("request", "session", "method", "route", "status", "ms")
"""Fields of a line beside its message"""


class LogStyle(StrEnum):
    """How the service logs."""

    QUIET = "quiet"
    """Warnings alone"""
    TEXT = "text"
    JSON = "json"
    """A line an object"""


def configure(style: LogStyle) -> None:
    """Have the loggers of the service write to standard error in that style."""
    if style is LogStyle.QUIET:
        return
    handler = logging.StreamHandler()
    handler.setFormatter(_JsonLines() if style is LogStyle.JSON else _TextLines())
    logger = logging.getLogger("service")
    logger.handlers[:] = [handler]
    logger.setLevel(logging.INFO)
    logger.propagate = False


class RequestLog:
    """Names requests, and logs each when it has been answered."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and log it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        name = given if _NAME.fullmatch(given) else secrets.token_hex(8)
        token = _request.set(name)
        start, status = time.perf_counter(), 500

        async def named(message: Message) -> None:
            nonlocal status
            if message["type"] in {"http.response.start", "websocket.http.response.start"}:
                status = message["status"]
                MutableHeaders(scope=message)["X-Request-Id"] = name
            elif message["type"] == "websocket.accept":
                status = 101
            elif message["type"] == "websocket.close" and status != 101:
                status = 403  # which is how a socket is told that is closed before it was opened
            await send(message)

        try:
            await self._app(scope, receive, named)
        finally:
            _log_request(scope, status, 1e3 * (time.perf_counter() - start))
            _request.reset(token)


def _log_request(scope: Scope, status: int, ms: float) -> None:
    if not _log.isEnabledFor(logging.INFO):
        return
    told = {
        "session": scope.get("path_params", {}).get("id"),
        "method": scope.get("method", "WS"),
        "route": getattr(scope.get("route"), "path", None),
        "status": status,
        "ms": round(ms, 1),
    }
    _log.info("answered", extra=told)


def _fields(record: logging.LogRecord) -> dict[str, object]:
    told = {name: getattr(record, name, None) for name in _TOLD}
    told["request"] = _request.get()
    return {name: value for name, value in told.items() if value is not None}


class _JsonLines(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": f"{self.formatTime(record, '%Y-%m-%dT%H:%M:%S')}.{int(record.msecs):03d}",
            "level": record.levelname.lower(),
            "message": record.getMessage(),
            **_fields(record),
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False, default=str)


class _TextLines(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        fields = " ".join(f"{name}={value}" for name, value in _fields(record).items())
        line = f"{self.formatTime(record)} {record.levelname.lower()} {record.getMessage()} {fields}".rstrip()
        return f"{line}\n{self.formatException(record.exc_info)}" if record.exc_info else line
