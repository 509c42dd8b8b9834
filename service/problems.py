"""Every error that a client can meet, as RFC 9457 problem details."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final, TypeAlias, get_args

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from service.cancellation import ClientGoneError
from service.hosting.lasting import KeyUsedError
from service.hosting.messages import Refusal, RefusalKind
from service.hosting.remote import RefusedError, WorkerGoneError
from service.hosting.sessions import NoSuchSessionError, TooManySessionsError
from service.journal.store import JournalError
from service.streaming.quota import TooManyStreamsError
from solver.errors import LimitExceededError, SceneError

MEDIA_TYPE: Final = "application/problem+json"


class FieldProblem(BaseModel):
    """What is wrong with one field of the input."""

    loc: list[str | int] = Field(
        description="Path of the field, from `body`, `query`, `path` or `header` on."
    )
    msg: str


class Problem(BaseModel):
    """What went wrong (RFC 9457)."""

    type: str = Field(description="A URI that names the kind of problem.", examples=["urn:halflight:invalid"])
    title: str = Field(examples=["The input is not acceptable"])
    status: int = Field(examples=[422])
    detail: str = Field(examples=["body.scene.objects.0.id: field required"])
    errors: list[FieldProblem] | None = Field(default=None, description="Of bad input: the very fields.")


@dataclass(frozen=True)
class Kind:
    """A kind of problem: its name, status and title."""

    name: str
    status: int
    title: str


INVALID: Final = Kind("invalid", 422, "The input is not acceptable")
NO_SUCH_SESSION: Final = Kind("no-such-session", 404, "There is no such session")
CONFLICT: Final = Kind("revision-conflict", 409, "The scene is at another revision")
NOTHING: Final = Kind("nothing-to-reverse", 409, "There is no edit batch to go to")
NOT_READY: Final = Kind("not-ready", 409, "What was asked for is not there yet")
LIMIT: Final = Kind("limit-exceeded", 413, "More than the limit was asked for")
TOO_MANY_SESSIONS: Final = Kind("too-many-sessions", 429, "There are too many sessions")
TOO_MANY_STREAMS: Final = Kind("too-many-streams", 429, "There are too many streams")
TOO_SLOW: Final = Kind("too-slow", 408, "The request came too slowly")
UNAUTHORIZED: Final = Kind("unauthorized", 401, "A bearer token is needed")
FORBIDDEN: Final = Kind("forbidden", 403, "This is not allowed")
UPGRADE: Final = Kind("upgrade-required", 426, "This call takes another protocol")
NOT_AVAILABLE: Final = Kind("not-available", 501, "This version cannot do that yet")
KEY_USED: Final = Kind("key-used", 422, "The key came with another request before")
NOT_KEPT: Final = Kind("not-kept", 503, "The session cannot be written or read")
WORKER_GONE: Final = Kind("worker-gone", 503, "The session's worker is gone")
NO_RENDERING: Final = Kind("no-rendering", 503, "This machine cannot draw frames")
UNSUPPORTED_MEDIA: Final = Kind("unsupported-media-type", 415, "The body is not JSON")
NOT_ACCEPTABLE: Final = Kind("not-acceptable", 406, "No such representation")
INTERNAL: Final = Kind("internal", 500, "Something went wrong inside")

_OF_REFUSAL: Final = {
    RefusalKind.INVALID: INVALID,
    RefusalKind.CONFLICT: CONFLICT,
    RefusalKind.NOTHING: NOTHING,
    RefusalKind.LIMIT: LIMIT,
    RefusalKind.NOT_AVAILABLE: NOT_AVAILABLE,
    RefusalKind.NO_RENDERING: NO_RENDERING,
    RefusalKind.NOT_READY: NOT_READY,
}

_PLAIN_MESSAGE: Final = {"extra_forbidden": "unknown field", "missing": "field required"}
"""Plainer words than pydantic's, by the type of its error."""

_PLAIN: Final = {
    404: "there is nothing at {path}",
    405: "{method} is not something to do to {path}",
}
"""Details of errors that the router raises, by their status."""

_TITLES: Final = {
    401: UNAUTHORIZED.title,
    404: NO_SUCH_SESSION.title,
    406: NOT_ACCEPTABLE.title,
    409: "The scene is at another revision, or what was asked for is not there yet",
    413: LIMIT.title,
    415: UNSUPPORTED_MEDIA.title,
    422: INVALID.title,
    429: "There are too many sessions, or too many streams",
    501: NOT_AVAILABLE.title,
    503: "The session's worker is gone, or this machine cannot draw frames",
}

MAX_ERRORS: Final = 20
"""Fields told of one bad input."""


class ProblemError(HTTPException):
    """A request is answered with a problem."""

    def __init__(
        self,
        kind: Kind,
        detail: str,
        errors: Sequence[FieldProblem] = (),
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(kind.status, detail, dict(headers or {}))
        self.kind = kind
        self.errors = errors

    @classmethod
    def of_field(cls, kind: Kind, location: Sequence[str | int], message: str) -> ProblemError:
        """A problem with one field of the input."""
        field = FieldProblem(loc=list(location), msg=message)
        return cls(kind, _tell([field]), [field])

    @classmethod
    def of_scene(cls, error: SceneError, source: Sequence[str | int]) -> ProblemError:
        """A scene or an edit that is not acceptable, located under `source`."""
        return cls.of_field(INVALID, [*source, *error.location], error.message)

    @classmethod
    def of_refusal(cls, refusal: Refusal, source: str) -> ProblemError:
        """What a worker refused; the input came from `source`: body or query."""
        kind = _OF_REFUSAL[refusal.kind]
        if refusal.location:
            return cls.of_field(kind, [source, *refusal.location], refusal.detail)
        return cls(kind, refusal.detail)

    @classmethod
    def of_fields(cls, found: Sequence[Mapping[str, Any]]) -> ProblemError:
        """Input that a model refused; `found` are pydantic's errors, located from the source on."""
        fields = [
            FieldProblem(loc=_location(error), msg=_PLAIN_MESSAGE.get(error["type"], error["msg"]))
            for error in found[:MAX_ERRORS]
        ]
        return cls(INVALID, _tell(fields), fields)

    @classmethod
    def of_error(cls, error: ToldError, source: str) -> ProblemError:
        """What was raised on purpose while input from `source` was served: body, query or message."""
        match error:
            case ProblemError():
                return error
            case RefusedError():
                return cls.of_refusal(error.refusal, source)
            case LimitExceededError():
                return cls(LIMIT, str(error))
            case NoSuchSessionError():
                return cls(NO_SUCH_SESSION, str(error))
            case TooManySessionsError():
                return cls(TOO_MANY_SESSIONS, str(error), headers=_later(error))
            case TooManyStreamsError():
                return cls(TOO_MANY_STREAMS, str(error), headers=_later(error))
            case WorkerGoneError():
                return cls(WORKER_GONE, str(error), headers=_later(error))
            case KeyUsedError():
                return cls.of_field(KEY_USED, ["header", "Idempotency-Key"], str(error))
            case JournalError():
                return cls(NOT_KEPT, "the change could not be kept, and is not made", headers=_later(error))

    @property
    def problem(self) -> Problem:
        """What a client is told."""
        return _problem(self.kind, str(self.detail), self.errors)


ToldError: TypeAlias = (
    ProblemError
    | RefusedError
    | LimitExceededError
    | NoSuchSessionError
    | TooManySessionsError
    | TooManyStreamsError
    | WorkerGoneError
    | KeyUsedError
    | JournalError
)
"""What is raised to be told a client"""

TOLD: Final[tuple[type[ToldError], ...]] = get_args(ToldError)
"""The same, to be caught"""


def _problem(kind: Kind, detail: str, errors: Sequence[FieldProblem]) -> Problem:
    return Problem(
        type=f"urn:halflight:{kind.name}" if kind.name else "about:blank",
        title=kind.title,
        status=kind.status,
        detail=detail,
        errors=list(errors) or None,
    )


def respond(
    kind: Kind, detail: str, errors: Sequence[FieldProblem] = (), headers: Mapping[str, str] | None = None
) -> JSONResponse:
    """The response that tells a problem."""
    told = _problem(kind, detail, errors).model_dump(exclude_none=True)
    return JSONResponse(told, kind.status, headers, MEDIA_TYPE)


def responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """What the API's description says of the problems that a call may meet."""
    schema = {"$ref": "#/components/schemas/Problem"}
    return {
        status: {"description": _TITLES[status], "content": {MEDIA_TYPE: {"schema": schema}}}
        for status in statuses
    }


def install(app: FastAPI) -> None:
    """Have every error of `app` told as a problem."""

    @app.exception_handler(HTTPException)
    async def of_http(request: Request, error: HTTPException) -> JSONResponse:
        if isinstance(error, ProblemError):
            return respond(error.kind, error.detail, error.errors, error.headers)
        phrase = HTTPStatus(error.status_code).phrase
        detail = _PLAIN.get(error.status_code, phrase).format(method=request.method, path=request.url.path)
        return respond(Kind("", error.status_code, phrase), detail, headers=error.headers)

    @app.exception_handler(RequestValidationError)
    async def of_input(_: Request, error: RequestValidationError) -> JSONResponse:
        told = ProblemError.of_fields(error.errors())
        return respond(told.kind, told.detail, told.errors)

    async def of_told(request: Request, error: Exception) -> JSONResponse:
        if not isinstance(error, TOLD):
            raise error
        told = ProblemError.of_error(error, "query" if request.method == "GET" else "body")
        return respond(told.kind, told.detail, told.errors, told.headers)

    for kind in TOLD:
        if kind is not ProblemError:
            app.add_exception_handler(kind, of_told)

    @app.exception_handler(ClientGoneError)
    async def of_nobody(_: Request, __: ClientGoneError) -> Response:
        return Response(status_code=499)

    @app.exception_handler(Exception)
    async def of_anything(_: Request, __: Exception) -> JSONResponse:
        # Starlette raises the exception again once this is sent, so that the server logs it.
        return respond(INTERNAL, "the service met an error that it did not expect, and has logged it")


def _later(error: Exception) -> dict[str, str]:
    """The header that says when to try again, where that helps."""
    seconds = getattr(error, "retry_after", None)
    return {} if seconds is None else {"Retry-After": str(seconds)}


def _location(found: Mapping[str, Any]) -> list[str | int]:
    """The path of a field in the input, without the branches of the models that pydantic puts into it."""
    location = list(found["loc"])
    if location[1:2] == ["edits"] and len(location) > 3:
        del location[3]
    return [*location, "op"] if found["type"].startswith("union_tag") else location


def _tell(fields: Sequence[FieldProblem]) -> str:
    first = f"{'.'.join(map(str, fields[0].loc))}: {fields[0].msg}"
    return first if len(fields) == 1 else f"{first} (and {len(fields) - 1} more)"
