"""Measuring points in a session's scene."""

from __future__ import annotations

import numpy as np
from fastapi import APIRouter

from service.context import Ctx, UsedSession
from service.hosting.messages import Probe
from service.json_body import JsonRoute
from service.problems import responses
from service.schemas import ProbeAnswer, ProbeRequest
from solver.errors import LimitExceededError

router = APIRouter(prefix="/v1", tags=["measurements"], route_class=JsonRoute)


@router.post("/sessions/{id}/probe", responses=responses(404, 413, 422, 503))
async def probe(body: ProbeRequest, session: UsedSession, context: Ctx) -> ProbeAnswer:
    """Irradiance at points: the exact gather at each from the current solution."""
    if len(body.points) > context.settings.max_probe_points:
        raise LimitExceededError("points", len(body.points), context.settings.max_probe_points)
    positions = np.array([point.position for point in body.points]).reshape(-1, 3)
    normals = np.array([point.normal for point in body.points]).reshape(-1, 3)
    return ProbeAnswer.of(await session.worker.call(Probe(positions, normals)))
