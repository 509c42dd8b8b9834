"""Edits of a session's scene."""

from __future__ import annotations

from fastapi import APIRouter

from service.context import Ctx, UsedSession
from service.hosting.messages import ApplyEdits
from service.json_body import JsonRoute
from service.problems import responses
from service.schemas import EditBatch, EditsAnswer, LogEntry
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
