"""Files of other formats as scene documents, so that their objects can be put into a session."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import BaseModel, Field

from service.file_body import FileRoute
from service.file_query import described
from service.problems import responses
from solver.document.fields import Closed
from solver.document.models import SceneDocument

router = APIRouter(prefix="/v1", tags=["scenes"], route_class=FileRoute)


class SceneFile(Closed):
    """A scene; or, with the content type of its format, the bytes of a file alone."""

    scene: SceneDocument


class ConvertedScene(BaseModel):
    """The scene of a file."""

    scene: SceneDocument
    warnings: list[str] = Field(description="What could not be kept: the scene's notes.")


@router.post(
    "/convert",
    response_model_exclude_unset=True,
    openapi_extra=described(),
    responses=responses(413, 422),
)
def convert(body: SceneFile) -> ConvertedScene:
    """The scene of a file, without a session: its objects can be added to one by edits."""
    return ConvertedScene(scene=body.scene, warnings=body.scene.notes)
