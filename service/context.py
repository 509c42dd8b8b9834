"""What every route may need: the app's settings, sessions and metrics, and the session that a path names."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Annotated, TypeAlias, cast

from fastapi import Depends, Path, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from service.config import ServiceSettings
from service.hosting.nursery import Nursery
from service.hosting.pool import WorkerPool
from service.hosting.sessions import Session, Sessions
from service.journal.journal import Journal
from service.metrics import Metrics
from service.ownership import owner_of
from service.streaming.quota import StreamQuota


@dataclass(frozen=True, eq=False)
class Context:
    """The state of one app."""

    settings: ServiceSettings
    pool: WorkerPool
    journal: Journal
    sessions: Sessions
    metrics: Metrics
    streams: StreamQuota
    nursery: Nursery | None = None
    """That workers come from, where it is of this app alone"""

    async def begin(self) -> None:
        """Have a worker warm, and all sessions that are kept; nothing where that is so.

        Raises WorkerNotStartedError, JournalError.
        """
        if self.journal.open():
            await self.sessions.load()
        await self.pool.begin()

    async def end(self) -> None:
        """End all processes; what is kept stays."""
        await self.sessions.close()
        await self.pool.close()
        await self.journal.close()
        if self.nursery is not None:
            await asyncio.to_thread(self.nursery.close)


def context_of(request: Request) -> Context:
    """The state of the app that serves the request."""
    return cast("Context", request.app.state.context)


Ctx: TypeAlias = Annotated[Context, Depends(context_of)]

_bearer = HTTPBearer(auto_error=False, description="Needed only where the service was started with a token.")


def require_token(
    context: Ctx, given: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]
) -> str | None:
    """Whose sessions the request may see, as `owner_of` tells it. Raises ProblemError."""
    return owner_of(b"" if given is None else given.credentials.encode(), context.settings)


Owner: TypeAlias = Annotated[str | None, Depends(require_token)]


async def session_of(
    context: Ctx, owner: Owner, session_id: Annotated[str, Path(alias="id", description="The session's id.")]
) -> AsyncIterator[Session]:
    """The session that the path names, kept awake while the request lasts."""
    with context.sessions.find(session_id, owner).in_use() as session:
        yield session


UsedSession: TypeAlias = Annotated[Session, Depends(session_of)]
