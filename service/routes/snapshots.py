"""Sessions as files: all of one but its light."""

from __future__ import annotations

import asyncio
from typing import Final

from fastapi import APIRouter, Response

from service.context import Ctx, UsedSession
from service.hosting.messages import GetStatus
from service.journal.documents import Snapshot, text_of
from service.journal.recollection import Recollection, snapshot_of
from service.json_body import JsonRoute
from service.problems import responses
from service.schemas import SessionStatus
from service.snapshots import accepted

router = APIRouter(prefix="/v1", tags=["sessions"], route_class=JsonRoute)

_FILE: Final = {
    "description": "The session but for its light, which settles anew",
    "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Snapshot"}}},
}


@router.get("/sessions/{id}/snapshot", response_class=Response, responses={200: _FILE, **responses(404, 503)})
async def session_snapshot(session: UsedSession) -> Response:
    """The session as a file: its scene, settings, history, revision and change log.

    Posted to `/v1/sessions` as `snapshot`, it makes another session that stands as this one does; posted
    here, later, it brings this one back.
    """
    recollection = await session.worker.recollect()
    text = await asyncio.to_thread(_text, recollection)
    named = {"Content-Disposition": f'attachment; filename="{session.id}.halflight.json"'}
    return Response(text, media_type="application/json", headers=named)


@router.post("/sessions/{id}/snapshot", responses=responses(404, 413, 422, 429, 503))
async def restore_session(body: Snapshot, session: UsedSession, context: Ctx) -> SessionStatus:
    """Bring the session back to a snapshot, its own or another's.

    All that it was is replaced, history and change log included. The revision is a new one, above that of
    the session and that of the snapshot, so that none stands for two scenes.
    """
    past, settings = await asyncio.to_thread(accepted, body, context.settings, ["body"])
    revision = max((await session.worker.call(GetStatus())).revision, past.revision) + 1
    snapshot = await asyncio.to_thread(snapshot_of, past, settings)
    await session.restore(snapshot.model_copy(update={"revision": revision}))
    return SessionStatus.of(session.id, await session.worker.call(GetStatus()))


def _text(recollection: Recollection) -> bytes:
    return text_of(recollection.snapshot())
