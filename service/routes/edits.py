"""Edits of a session's scene."""

from __future__ import annotations

from fastapi import APIRouter

from service.context import Ctx, UsedSession
from service.hosting import messages
from service.hosting.lasting import Edits
from service.hosting.messages import ApplyEdits, GetLog, Redo, Undo
from service.hosting.sessions import Session
from service.idempotency import Key
from service.json_body import JsonRoute
from service.problems import responses
from service.schemas import EditBatch, EditsAnswer, LogAnswer, LogEntry
from solver.errors import LimitExceededError

router = APIRouter(prefix="/v1", tags=["edits"], route_class=JsonRoute)


@router.post("/sessions/{id}/edits", responses=responses(404, 409, 413, 422, 503))
async def apply_edits(
    body: EditBatch, session: UsedSession, context: Ctx, idempotency_key: Key = None
) -> EditsAnswer:
    """Apply a batch of edits: all of them, or none.

    Once it is answered it is kept, whatever becomes of processes; one that is sent again with its
    `Idempotency-Key` is answered again and not applied again.
    The answer comes before the light has settled; frames of the new revision show the new geometry from
    now on.
    """
    if len(body.edits) > context.settings.max_edits:
        raise LimitExceededError("edits", len(body.edits), context.settings.max_edits)
    request = ApplyEdits(tuple(body.edits), body.if_revision, body.gesture)
    answer = await _once(session, request, idempotency_key)
    for edit in body.edits:
        context.metrics.edits.labels(edit.op).inc()
    return EditsAnswer(revision=answer.revision, changes=[LogEntry.of(change) for change in answer.changes])


@router.post("/sessions/{id}/undo", responses=responses(404, 409, 422, 503))
async def undo_edits(session: UsedSession, idempotency_key: Key = None) -> EditsAnswer:
    """Take back the newest edit batch that stands: a new revision, as by a batch that undoes it.

    409 where there is none. The thousand newest batches can be taken back.
    """
    answer = await _once(session, Undo(), idempotency_key)
    return EditsAnswer(revision=answer.revision, changes=[LogEntry.of(change) for change in answer.changes])


@router.post("/sessions/{id}/redo", responses=responses(404, 409, 422, 503))
async def redo_edits(session: UsedSession, idempotency_key: Key = None) -> EditsAnswer:
    """Bring back the batch that was taken back last. 409 where there is none, as after any other edit."""
    answer = await _once(session, Redo(), idempotency_key)
    return EditsAnswer(revision=answer.revision, changes=[LogEntry.of(change) for change in answer.changes])


@router.get("/sessions/{id}/log", responses=responses(404, 503))
async def change_log(session: UsedSession) -> LogAnswer:
    """What has been changed, and how far the light has followed, oldest first.

    Consecutive moves of one object are one removal and one addition. Once every entry is settled, the
    solution is that of the scene as it stands, within the tolerance.
    """
    answer = await session.worker.call(GetLog())
    return LogAnswer(revision=answer.revision, entries=[LogEntry.of(change) for change in answer.changes])


async def _once(session: Session, request: Edits, key: str | None) -> messages.EditsAnswer:
    return await (session.worker.call(request) if key is None else session.worker.call_once(request, key))
