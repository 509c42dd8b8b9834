"""What is not part of a session: health, metrics, and the viewer."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import PurePosixPath
from typing import Final

from fastapi import APIRouter, Depends, HTTPException, Response

from service.context import Ctx, require_token
from service.openapi import version
from service.schemas import Health

router = APIRouter(tags=["service"])

_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS: Final = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
_TYPES: Final = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


@router.get("/healthz")
async def health(context: Ctx) -> Health:
    """The service is up."""
    return Health(version=version(), sessions=len(context.sessions))


@router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"description": "Counters", "content": {"text/plain": {"schema": {"type": "string"}}}}},
    dependencies=[Depends(require_token)],
)
async def metrics(context: Ctx) -> Response:
    """What the service counts of itself, in Prometheus's text format."""
    return Response(context.metrics.text(), media_type=context.metrics.content_type)


@router.get("/", include_in_schema=False)
async def front_page() -> Response:
    """The viewer."""
    return _file("index.html")


@router.get("/page/{name}", include_in_schema=False)
async def part(name: str) -> Response:
    """A style, a script or a picture of the viewer."""
    return _file(name)


def _file(name: str) -> Response:
    found = _contents().get(name)
    if found is None:
        raise HTTPException(404)
    return Response(found, media_type=_TYPES[PurePosixPath(name).suffix], headers=_HEADERS)


@cache
def _contents() -> dict[str, bytes]:
    """The viewer's files by their names."""
    folder = resources.files("service").joinpath("page")
    return {
        file.name: file.read_bytes() for file in folder.iterdir() if PurePosixPath(file.name).suffix in _TYPES
    }
