"""A session's status as it changes, as Server-Sent Events."""

from __future__ import annotations

from collections.abc import AsyncIterator

from fastapi import APIRouter
from fastapi.sse import EventSourceResponse, ServerSentEvent

from service.context import UsedSession
from service.problems import responses
from service.schemas import SessionStatus

router = APIRouter(tags=["sessions"])


@router.get(
    "/sessions/{id}/events", response_class=EventSourceResponse, responses=responses(404, 503)
)
async def session_events(session: UsedSession) -> AsyncIterator[ServerSentEvent]:
    """Every change of status, as events `status` whose data is the status; the first at once.

    Where changes come faster than the client reads, it gets the latest. The stream ends with an event
    `end` when the session does.
    """
    worker = session.worker
    told = None
    while not worker.gone:
        news = worker.news()
        if worker.status is not None and worker.status is not told:
            told = worker.status
            yield ServerSentEvent(SessionStatus.of(session.id, told), event="status", id=str(told.revision))
        else:
            await worker.news()
    yield ServerSentEvent(event="end", raw_data="{}")
