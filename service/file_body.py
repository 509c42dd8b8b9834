"""Request bodies that are files of other formats: read here, so that a route sees a scene as in JSON."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any, Final

from fastapi import Request
from fastapi.security import HTTPBearer
from pydantic import ValidationError

from service.context import Context, require_token
from service.file_query import MEDIA_TYPES, FileQuery
from service.json_body import JsonRoute, parse_json
from service.problems import INVALID, ProblemError
from solver.document.models import SceneDocument
from solver.document.settings import SettingsDocument
from solver.errors import SceneError
from solver.formats.reading import SceneFormat, read_scene
from solver.formats.source import SourceFile

_JSON: Final = (b"content-type", b"application/json")

_BEARER: Final = HTTPBearer(auto_error=False)

_UNPACKED: Final = 4
"""Bytes that an archive may unpack to, over those that a body may have"""


class FileRoute(JsonRoute):
    """A route whose body is JSON, or a file whose scene is the body's member `scene`."""

    async def parsed(self, request: Request) -> Request:
        """The request as FastAPI is to see it. Raises ProblemError, LimitExceededError."""
        media = request.headers.get("content-type", "").partition(";")[0].strip().lower()
        if media not in MEDIA_TYPES:
            return await super().parsed(request)
        context: Context = request.app.state.context
        # Reading a file is work, which is not done for who may not ask for it.
        require_token(context, await _BEARER(request))
        query = _query_of(request)
        chosen = MEDIA_TYPES[media] or query.format
        if chosen is None:
            raise ProblemError.of_field(
                INVALID, ["query", "format"], "say which format the file has: " + ", ".join(SceneFormat)
            )
        value: dict[str, object] = {}
        if query.settings is not None:
            value["settings"] = _settings_of(query.settings)
        value["scene"] = await _scene_of(await request.body(), chosen, query, context)
        return _ReadRequest(request, value)


class _ReadRequest(Request):
    """A request whose body has been read, and stands for that JSON."""

    def __init__(self, request: Request, value: object) -> None:
        headers = [pair for pair in request.scope["headers"] if pair[0] != b"content-type"]
        super().__init__({**request.scope, "headers": [*headers, _JSON]}, request.receive)
        self._value = value

    async def body(self) -> bytes:
        """Something."""
        return b"{}"

    async def json(self) -> Any:
        """What it stands for; models in it are valid already."""
        return self._value


def _query_of(request: Request) -> FileQuery:
    """What the query says. Raises ProblemError."""
    given = request.query_params
    twice = next((name for name in given if len(given.getlist(name)) > 1), None)
    if twice is not None:
        raise ProblemError.of_field(INVALID, ["query", twice], "this is given more than once")
    try:
        return FileQuery.model_validate(dict(given))
    except ValidationError as refused:
        raise ProblemError.of_fields(_placed(refused, ("query",))) from None


def _settings_of(text: str) -> SettingsDocument:
    """The settings that a query holds. Raises ProblemError."""
    try:
        value = parse_json(text.encode("utf-8", "replace"))
    except ValueError as refused:
        raise ProblemError.of_field(
            INVALID, ["query", "settings"], f"not acceptable JSON: {refused}"
        ) from None
    try:
        return SettingsDocument.model_validate(value)
    except ValidationError as refused:
        raise ProblemError.of_fields(_placed(refused, ("query", "settings"))) from None


async def _scene_of(content: bytes, chosen: SceneFormat, query: FileQuery, context: Context) -> SceneDocument:
    """The scene document of a file. Raises ProblemError, LimitExceededError."""
    limits = context.settings
    source = SourceFile(query.name or "scene", content)
    most = _UNPACKED * limits.max_body_bytes
    try:
        imported = await asyncio.to_thread(
            read_scene, source, chosen, query.options(limits.scene_limits), most
        )
    except SceneError as refused:
        raise ProblemError.of_scene(refused, ["body"]) from None
    document = imported.document
    if query.name:
        document = document.model_copy(update={"name": query.name})
    return document


def _placed(refused: ValidationError, place: tuple[str, ...]) -> list[Mapping[str, Any]]:
    """What a model has refused, located from `place` on."""
    found = refused.errors(include_url=False, include_context=False, include_input=False)
    return [{**error, "loc": (*place, *error["loc"])} for error in found]
