"""What a pixel of a session's frame shows."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from service.context import UsedSession
from service.hosting.messages import GetPick
from service.overlay_query import PickQuery
from service.problems import responses
from service.schemas import PickAnswer

router = APIRouter(prefix="/v1", tags=["measurements"])


@router.get("/sessions/{id}/pick", responses=responses(404, 413, 422, 503))
async def pick(query: Annotated[PickQuery, Query()], session: UsedSession) -> PickAnswer:
    """What a pixel shows: its object, face and point, and the light there as a frame drawn now has it."""
    return PickAnswer.of(await session.worker.call(GetPick(query.choice(), query.x, query.y)))
