"""What is not part of a session: health, metrics, and the page that shows a scene at once."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Final

from fastapi import APIRouter, Depends, Response

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
    """A page that shows a scene that ships with the service, its frame and its progress."""
    return _file("index.html", "text/html; charset=utf-8")


@router.get("/page/page.css", include_in_schema=False)
async def style() -> Response:
    """The page's style."""
    return _file("page.css", "text/css; charset=utf-8")


@router.get("/page/page.js", include_in_schema=False)
async def script() -> Response:
    """The page's script."""
    return _file("page.js", "text/javascript; charset=utf-8")


def _file(name: str, media_type: str) -> Response:
    return Response(_content(name), media_type=media_type, headers=_HEADERS)


@cache
def _content(name: str) -> bytes:
    return resources.files("service").joinpath("page", name).read_bytes()
