"""Frames of a session: what a camera sees of it, as a file."""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import APIRouter, Header, Query, Request, Response

from service.cancellation import unless_gone
from service.context import Ctx, UsedSession
from service.frame_query import FrameQuery
from service.hosting.messages import FrameAnswer, GetFrame
from service.negotiation import MEDIA_TYPES, choose_format, known_tags
from service.problems import responses

router = APIRouter(prefix="/v1", tags=["frames"])

_HEADERS: Final = {
    "ETag": {"description": "Names this very picture.", "schema": {"type": "string"}},
    "X-Revision": {"description": "The revision whose geometry it shows.", "schema": {"type": "integer"}},
    "X-Error-Estimate": {
        "description": "Estimated relative error of the light in it.",
        "schema": {"type": "number"},
    },
    "X-Converged": {
        "description": "Whether that is within the tolerance of the settings.",
        "schema": {"type": "string", "enum": ["true", "false"]},
    },
    "X-Render-Ms": {"description": "What drawing it took, without encoding.", "schema": {"type": "number"}},
    "X-Renderer": {"description": "What drew it.", "schema": {"type": "string"}},
}
_FRAME: Final = {
    "description": "The frame",
    "headers": _HEADERS,
    "content": {media: {"schema": {"type": "string", "format": "binary"}} for media in MEDIA_TYPES.values()},
}
_NOT_MODIFIED: Final = {"description": "The client has this very frame already", "headers": _HEADERS}


@router.get(
    "/sessions/{id}/frame",
    response_class=Response,
    responses={200: _FRAME, 304: _NOT_MODIFIED, **responses(404, 406, 413, 422, 501, 503)},
)
async def session_frame(
    query: Annotated[FrameQuery, Query()],
    session: UsedSession,
    context: Ctx,
    request: Request,
    accept: Annotated[str, Header(description="Chooses the format where `format` does not.")] = "",
    if_none_match: Annotated[str, Header(description="ETags of frames that the client has.")] = "",
) -> Response:
    """A frame of the scene as it stands, with the light as far as it is solved.

    The geometry is always that of `X-Revision`; `wait` says how good the light must be.
    """
    chosen = query.format or choose_format(accept)
    asked = GetFrame(
        frame=query.frame(),
        encoding=query.encoding(chosen),
        wait=query.waiting(),
        timeout=query.longest(float(context.settings.max_wait_ms)),
        known_tags=known_tags(if_none_match),
        is_budget=query.budget_ms is not None,
    )
    answer = await unless_gone(request, session.worker.call(asked))
    context.metrics.frames.labels(answer.outlook.renderer).observe(answer.seconds)
    headers = _headers_of(answer) if query.format else {**_headers_of(answer), "Vary": "Accept"}
    if answer.content is None:
        return Response(status_code=304, headers=headers)
    return Response(answer.content, media_type=MEDIA_TYPES[chosen], headers=headers)


def _headers_of(answer: FrameAnswer) -> dict[str, str]:
    outlook = answer.outlook
    return {
        "ETag": f'"{answer.tag}"',
        "Cache-Control": "no-cache",
        "X-Revision": str(outlook.revision),
        "X-Error-Estimate": f"{outlook.error_estimate:.6g}",
        "X-Converged": "true" if outlook.converged else "false",
        "X-Render-Ms": f"{1000.0 * answer.seconds:.3f}",
        "X-Renderer": outlook.renderer.value,
    }
