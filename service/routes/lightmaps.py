"""Lightmaps of a session: the irradiance of its surfaces as a texture."""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import APIRouter, Header, Query, Request, Response

from service.cancellation import unless_gone
from service.context import Ctx, UsedSession
from service.hosting.messages import GetLightmap, LightmapAnswer
from service.lightmap_query import LightmapQuery
from service.negotiation import LIGHTMAP_TYPES, choose_lightmap_format
from service.overlay_query import OverlayWait
from service.problems import responses

router = APIRouter(prefix="/v1", tags=["lightmaps"])

_HEADERS: Final = {
    "X-Revision": {"description": "The revision that it is of.", "schema": {"type": "integer"}},
    "X-Texels-Per-Metre": {"description": "Its density, at least.", "schema": {"type": "number"}},
    "X-Lightmap-Size": {
        "description": "Width and height of the picture, like `512x480`.",
        "schema": {"type": "string"},
    },
    "X-White-Irradiance": {
        "description": "W/m2 of irradiance that the picture shows white.",
        "schema": {"type": "number"},
    },
    "X-Method": {
        "description": "How light has come to texels: the paths of virtual lights, `exact` or `solution`.",
        "schema": {"type": "string"},
    },
    "X-Error-Estimate": {
        "description": "Estimated relative error of the light in it.",
        "schema": {"type": "number"},
    },
    "X-Converged": {
        "description": "Whether all is there, within the tolerance of the settings.",
        "schema": {"type": "string", "enum": ["true", "false"]},
    },
}
_LIGHTMAP: Final = {
    "description": "The lightmap",
    "headers": _HEADERS,
    "content": {
        media: {"schema": {"type": "string", "format": "binary"}} for media in LIGHTMAP_TYPES.values()
    },
}


@router.get(
    "/sessions/{id}/lightmap",
    response_class=Response,
    responses={200: _LIGHTMAP, **responses(404, 406, 409, 413, 422, 503)},
)
async def session_lightmap(
    query: Annotated[LightmapQuery, Query()],
    session: UsedSession,
    context: Ctx,
    request: Request,
    accept: Annotated[str, Header(description="Chooses the format where `format` does not.")] = "",
) -> Response:
    """The irradiance of all surfaces of the scene as it stands, baked into one picture."""
    chosen = query.format or choose_lightmap_format(accept)
    asked = GetLightmap(
        lightmap=query.request(),
        format=chosen,
        white=query.white,
        complete=query.wait is OverlayWait.CONVERGED,
        timeout=query.longest(float(context.settings.max_wait_ms)),
    )
    answer = await unless_gone(request, session.worker.call(asked))
    headers = _headers_of(answer) if query.format else {**_headers_of(answer), "Vary": "Accept"}
    return Response(answer.content, media_type=LIGHTMAP_TYPES[chosen], headers=headers)


def _headers_of(answer: LightmapAnswer) -> dict[str, str]:
    return {
        "Cache-Control": "no-cache",
        "X-Revision": str(answer.revision),
        "X-Texels-Per-Metre": f"{answer.density:.9g}",
        "X-Lightmap-Size": f"{answer.width}x{answer.height}",
        "X-White-Irradiance": f"{answer.white:.9g}",
        "X-Method": answer.method,
        "X-Error-Estimate": f"{answer.error_estimate:.6g}",
        "X-Converged": "true" if answer.converged else "false",
    }
