"""A session's status as it changes, as Server-Sent Events."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi.sse import EventSourceResponse, ServerSentEvent

from service.context import Ctx, UsedSession
from service.hosting.messages import GetStatus
from service.hosting.sessions import Session
from service.problems import responses
from service.schemas import SessionStatus

router = APIRouter(prefix="/v1", tags=["sessions"])


async def living(session: UsedSession, context: Ctx) -> AsyncIterator[Session]:
    """The session that the path names, awake. Raises what waking does, and TooManyStreamsError."""
    with context.streams.taken(session.id):
        await session.worker.call(GetStatus())
        yield session


@router.get("/sessions/{id}/events", response_class=EventSourceResponse, responses=responses(404, 429, 503))
async def session_events(session: Annotated[Session, Depends(living)]) -> AsyncIterator[ServerSentEvent]:
    """Every change of status, as events `status` whose data is the status; the first at once.

    Where changes come faster than the client reads, it gets the latest. The stream ends with an event
    `end` when the session does.
    """
    worker = session.worker
    told = None
    while not worker.gone:
        if worker.status is not None and worker.status is not told:
            told = worker.status
            yield ServerSentEvent(data=SessionStatus.of(session.id, told), event="status")
        else:
            await worker.news()
    yield ServerSentEvent(data={}, event="end")
