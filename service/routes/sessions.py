"""Sessions: open, list, look at, configure, end."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter, Request, Response

from service.config import ServiceSettings
from service.context import Ctx, Owner, UsedSession
from service.file_body import FileRoute
from service.file_query import described
from service.hosting.messages import Configure, GetScene, GetStatus
from service.hosting.sessions import Session
from service.idempotency import Key
from service.json_body import JsonRoute
from service.problems import INVALID, ProblemError, responses
from service.schemas import SceneAnswer, SessionList, SessionRequest, SessionStatus
from service.snapshots import accepted
from solver.document.conversion import document_of, scene_of
from solver.document.limits import SceneLimits
from solver.document.models import SceneDocument
from solver.document.samples import load_sample
from solver.document.settings import SettingsDocument
from solver.engine.past import Past
from solver.errors import SceneError
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings

router = APIRouter(prefix="/v1", tags=["sessions"], route_class=JsonRoute)
_opening = APIRouter(route_class=FileRoute)


@_opening.post(
    "/sessions", status_code=201, openapi_extra=described(), responses=responses(413, 422, 429, 503)
)
async def open_session(
    body: SessionRequest,
    request: Request,
    response: Response,
    context: Ctx,
    owner: Owner,
    idempotency_key: Key = None,
) -> SessionStatus:
    """Open a session on a scene. The solve starts at once.

    One that is sent again with its `Idempotency-Key` is answered with the session that it has opened.

    The scene may come as JSON, or as a file of another format, with its content type; what its reader could
    not keep is among the session's warnings.
    """
    limits = context.settings
    scene, settings = await asyncio.to_thread(_start, body, limits)
    session, status = await context.sessions.open(
        limits.terms.opening(scene, settings), owner or "", idempotency_key
    )
    context.metrics.sessions_opened.inc()
    response.headers["Location"] = request.url_for("session_status", id=session.id).path
    return SessionStatus.of(session.id, status)


router.include_router(_opening)


def _start(body: SessionRequest, limits: ServiceSettings) -> tuple[Scene | Past, LightSettings]:
    """What is asked for, within the limits."""
    if sum(given is not None for given in (body.scene, body.sample, body.snapshot)) != 1:
        told = "give one of these: a scene, the name of a sample, or a snapshot"
        raise ProblemError.of_field(INVALID, ["body", "scene"], told)
    if body.snapshot is not None:
        return accepted(body.snapshot, limits, ["body", "snapshot"], body.settings)
    settings = body.settings.changes_to(limits.solver_defaults)
    limits.check_solver(settings)
    return _scene(body, limits.scene_limits), settings


def _scene(body: SessionRequest, limits: SceneLimits) -> Scene:
    try:
        if body.sample is not None:
            return load_sample(body.sample)
        document = body.scene or SceneDocument()
        limits.check_document(document)
        return scene_of(document)
    except SceneError as error:
        raise ProblemError.of_scene(error, ["body"] if body.scene is None else ["body", "scene"]) from None


@router.get("/sessions")
async def list_sessions(context: Ctx, owner: Owner) -> SessionList:
    """The sessions that the service holds."""
    return SessionList(
        sessions=[_listed(session) for session in context.sessions if owner in (None, session.owner)]
    )


def _listed(session: Session) -> SessionStatus:
    status = session.worker.status
    if status is None:
        return SessionStatus.asleep(session.id, session.name, session.revision, session.settings)
    return (SessionStatus.lost if session.worker.gone else SessionStatus.of)(session.id, status)


@router.get("/sessions/{id}", responses=responses(404, 503))
async def session_status(session: UsedSession) -> SessionStatus:
    """How a session stands."""
    return SessionStatus.of(session.id, await session.worker.call(GetStatus()))


@router.delete("/sessions/{id}", status_code=204, responses=responses(404))
async def end_session(id: str, context: Ctx, owner: Owner) -> None:
    """End a session and free all that it holds."""
    await context.sessions.end(id, owner)


@router.get("/sessions/{id}/scene", response_model_exclude_unset=True, responses=responses(404, 503))
async def session_scene(session: UsedSession) -> SceneAnswer:
    """The scene as it stands. Posted back, it gives an equal session."""
    answer = await session.worker.call(GetScene())
    return SceneAnswer(revision=answer.revision, scene=document_of(answer.scene))


@router.patch("/sessions/{id}/settings", responses=responses(404, 413, 422, 503))
async def configure_session(body: SettingsDocument, session: UsedSession, context: Ctx) -> SessionStatus:
    """Change the settings that are given, while the session runs."""
    context.settings.check_solver(body.changes_to(context.settings.solver_defaults))
    return SessionStatus.of(session.id, await session.worker.call(Configure(body)))
