"""Edits of a session's scene."""

from __future__ import annotations

from fastapi import APIRouter

from service.context import Ctx, UsedSession
from service.hosting.messages import ApplyEdits, GetLog, Redo, Undo
from service.json_body import JsonRoute
from service.problems import responses
from service.schemas import EditBatch, EditsAnswer, LogAnswer, LogEntry
from solver.errors import LimitExceededError

router = APIRouter(prefix="/v1", tags=["edits"], route_class=JsonRoute)


@router.post("/sessions/{id}/edits", responses=responses(404, 409, 413, 422, 503))
async def apply_edits(body: EditBatch, session: UsedSession, context: Ctx) -> EditsAnswer:
    """Apply a batch of edits: all of them, or none.

    The answer comes before the light has settled; frames of the new revision show the new geometry from
    now on.
    """
    if len(body.edits) > context.settings.max_edits:
        raise LimitExceededError("edits", len(body.edits), context.settings.max_edits)
    answer = await session.worker.call(ApplyEdits(tuple(body.edits), body.if_revision))
    for edit in body.edits:
        context.metrics.edits.labels(edit.op).inc()
    return EditsAnswer(revision=answer.revision, changes=[LogEntry.of(change) for change in answer.changes])


@router.post("/sessions/{id}/undo", responses=responses(404, 409, 503))
async def undo_edits(session: UsedSession) -> EditsAnswer:
    """Take back the newest edit batch that stands: a new revision, as by a batch that undoes it.

    409 where there is none. The thousand newest batches can be taken back.
    """
    answer = await session.worker.call(Undo())
    return EditsAnswer(revision=answer.revision, changes=[LogEntry.of(change) for change in answer.changes])


@router.post("/sessions/{id}/redo", responses=responses(404, 409, 503))
async def redo_edits(session: UsedSession) -> EditsAnswer:
    """Bring back the batch that was taken back last. 409 where there is none, as after any other edit."""
    answer = await session.worker.call(Redo())
    return EditsAnswer(revision=answer.revision, changes=[LogEntry.of(change) for change in answer.changes])


@router.get("/sessions/{id}/log", responses=responses(404, 503))
async def change_log(session: UsedSession) -> LogAnswer:
    """What has been changed, and how far the light has followed, oldest first.

    Consecutive moves of one object are one removal and one addition. Once every entry is settled, the
    solution is that of the scene as it stands, within the tolerance.
    """
    answer = await session.worker.call(GetLog())
    return LogAnswer(revision=answer.revision, entries=[LogEntry.of(change) for change in answer.changes])
