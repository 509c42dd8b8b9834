"""What every route may need: the app's settings, sessions and metrics, and the session that a path names."""

from __future__ import annotations

import secrets
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Annotated, TypeAlias, cast

from fastapi import Depends, Path, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from service.config import ServiceSettings
from service.hosting.pool import WorkerPool
from service.hosting.sessions import Session, Sessions
from service.metrics import Metrics
from service.problems import UNAUTHORIZED, ProblemError


@dataclass(frozen=True, eq=False)
class Context:
    """The state of one app."""

    settings: ServiceSettings
    pool: WorkerPool
    sessions: Sessions
    metrics: Metrics


def context_of(request: Request) -> Context:
    """The state of the app that serves the request."""
    return cast("Context", request.app.state.context)


Ctx: TypeAlias = Annotated[Context, Depends(context_of)]

_bearer = HTTPBearer(auto_error=False, description="Needed only where the service was started with a token.")


def require_token(
    context: Ctx, given: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]
) -> None:
    """Raise ProblemError where the service has a token and the request does not."""
    token = context.settings.token
    if token is None:
        return
    if given is None or not secrets.compare_digest(
        given.credentials.encode(), token.get_secret_value().encode()
    ):
        raise ProblemError(
            UNAUTHORIZED,
            "send the service's token as Authorization: Bearer <token>",
            headers={"WWW-Authenticate": "Bearer"},
        )


async def session_of(
    context: Ctx, session_id: Annotated[str, Path(alias="id", description="The session's id.")]
) -> AsyncIterator[Session]:
    """The session that the path names, kept from expiring while the request lasts."""
    with context.sessions.find(session_id).in_use() as session:
        yield session


UsedSession: TypeAlias = Annotated[Session, Depends(session_of)]
