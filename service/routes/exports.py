"""A session for other programs: as a file, and as a table of what light meters read."""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import APIRouter, Query, Request, Response

from service.cancellation import unless_gone
from service.context import Ctx, UsedSession
from service.export_query import ExportQuery, GridQuery
from service.hosting.messages import GetExport, GetGrid
from service.overlay_query import OverlayWait
from service.problems import responses
from solver.engine.exports.files import Export, ExportFormat

router = APIRouter(prefix="/v1", tags=["exports"])

MEDIA_TYPES: Final = {
    ExportFormat.GLB: "model/gltf-binary",
    ExportFormat.NPZ: "application/x-npz",
    ExportFormat.VTU: "application/vnd.vtk.vtu+xml",
    ExportFormat.JSON: "application/json",
}
_CSV: Final = "text/csv"

_HEADERS: Final = {
    "X-Revision": {"description": "The revision that it is of.", "schema": {"type": "integer"}},
    "X-Error-Estimate": {
        "description": "Estimated relative error of the light in it.",
        "schema": {"type": "number"},
    },
    "X-Converged": {
        "description": "Whether the solution is within the tolerance of the settings.",
        "schema": {"type": "string", "enum": ["true", "false"]},
    },
}
_BINARY: Final = {"schema": {"type": "string", "format": "binary"}}
_FILE: Final = {
    "description": "The file",
    "headers": _HEADERS,
    "content": dict.fromkeys(MEDIA_TYPES.values(), _BINARY),
}
_TABLE: Final = {
    "description": "A line for each point: the face, or -1, the place in metres, the direction, lux, W/m2 of "
    "R, G and B, and the estimated relative error.",
    "headers": _HEADERS,
    "content": {_CSV: {"schema": {"type": "string"}}},
}


@router.get(
    "/sessions/{id}/export",
    response_class=Response,
    responses={200: _FILE, **responses(404, 422, 503)},
)
async def session_export(
    query: Annotated[ExportQuery, Query()], session: UsedSession, context: Ctx, request: Request
) -> Response:
    """The session as a file: its scene, edits and all, with the light as far as it has come."""
    asked = GetExport(
        export=query.request(),
        complete=query.wait is OverlayWait.CONVERGED,
        timeout=query.longest(float(context.settings.max_wait_ms)),
    )
    answer = await unless_gone(request, session.worker.call(asked))
    headers = _headers_of(answer)
    headers["Content-Disposition"] = f'attachment; filename="{session.id}.{query.format}"'
    return Response(answer.content, media_type=MEDIA_TYPES[query.format], headers=headers)


@router.get(
    "/sessions/{id}/grid",
    response_class=Response,
    responses={200: _TABLE, **responses(404, 413, 422, 503)},
)
async def session_grid(
    query: Annotated[GridQuery, Query()], session: UsedSession, context: Ctx, request: Request
) -> Response:
    """Illuminance over a grid of points, as CSV: the exact gather at each, as probes have it."""
    asked = GetGrid(
        grid=query.request(context.settings.max_probe_points),
        complete=query.wait is OverlayWait.CONVERGED,
        timeout=query.longest(float(context.settings.max_wait_ms)),
    )
    answer = await unless_gone(request, session.worker.call(asked))
    return Response(answer.content, media_type=_CSV, headers=_headers_of(answer))


def _headers_of(answer: Export) -> dict[str, str]:
    return {
        "Cache-Control": "no-cache",
        "X-Revision": str(answer.revision),
        "X-Error-Estimate": f"{answer.error_estimate:.6g}",
        "X-Converged": "true" if answer.converged else "false",
    }
