"""Visualizations of a session's insides: elements, links, discontinuities, triangles, samples, graphs."""

from __future__ import annotations

from typing import Annotated, Any, Final, TypeAlias

from fastapi import APIRouter, Depends, Header, Query, Request, Response
from fastapi.routing import APIRoute
from pydantic import BaseModel

from service import overlay_query as queries
from service import overlay_schemas as schemas
from service.cancellation import unless_gone
from service.context import Ctx, UsedSession
from service.hosting.messages import GetOverlay, GetStatus
from service.negotiation import OVERLAY_TYPES, choose_overlay_format
from service.problems import responses

_ROOT: Final = "/sessions/{id}/overlays"

router = APIRouter(prefix="/v1", tags=["overlays"])


class Showing:
    """Has a session's overlays made, and sends them."""

    def __init__(
        self,
        session: UsedSession,
        context: Ctx,
        request: Request,
        accept: Annotated[str, Header(description="Chooses the format where `format` does not.")] = "",
    ) -> None:
        self._session = session
        self._longest = float(context.settings.max_wait_ms)
        self._request = request
        self._accept = accept

    async def __call__(self, query: queries.OverlayQuery) -> Response:
        """The answer to `query`. Raises ProblemError, RefusedError, WorkerGoneError."""
        chosen = query.format or choose_overlay_format(self._accept)
        asked = GetOverlay(query.request(), chosen, query.longest(self._longest))
        answer = await unless_gone(self._request, self._session.worker.call(asked))
        headers = {"Cache-Control": "no-cache"} | ({} if query.format else {"Vary": "Accept"})
        return Response(answer.content, media_type=OVERLAY_TYPES[chosen], headers=headers)


Show: TypeAlias = Annotated[Showing, Depends()]


def _told(model: type[BaseModel], *statuses: int) -> dict[str, Any]:
    """What the API's description says of an overlay."""
    files = {media: {"schema": {"type": "string", "format": "binary"}} for media in OVERLAY_TYPES.values()}
    del files["application/json"]
    shown = {"description": "The overlay", "model": model, "content": files}
    return {
        "response_class": Response,
        "responses": {200: shown, **responses(404, 406, 422, 503, *statuses)},
    }


@router.get("/sessions/{id}/overlays", responses=responses(404, 503))
async def overlay_list(session: UsedSession, request: Request) -> schemas.OverlayList:
    """The overlays that there are."""
    status = await session.worker.call(GetStatus())
    return schemas.OverlayList(
        revision=status.revision,
        overlays=[
            schemas.OverlayLink(
                name=route.path.rpartition("/")[2],
                href=request.url_for(route.name, id=session.id).path,
                shows=route.description.partition("\n")[0],
            )
            for route in router.routes
            if isinstance(route, APIRoute) and route.endpoint is not overlay_list
        ],
    )


@router.get(f"{_ROOT}/mesh", **_told(schemas.MeshAnswer))
async def overlay_mesh(query: Annotated[queries.MeshQuery, Query()], show: Show) -> Response:
    """The element hierarchy, cut at a depth, coloured by radiosity or reflectance."""
    return await show(query)


@router.get(f"{_ROOT}/links", **_told(schemas.LinksAnswer))
async def overlay_links(query: Annotated[queries.LinksQuery, Query()], show: Show) -> Response:
    """The links between elements: form factor, visibility, rays."""
    return await show(query)


@router.get(f"{_ROOT}/blockers", **_told(schemas.BlockersAnswer))
async def overlay_blockers(query: Annotated[queries.BlockersQuery, Query()], show: Show) -> Response:
    """What may stand between the ends of a link."""
    return await show(query)


@router.get(f"{_ROOT}/discontinuities", **_told(schemas.DiscontinuitiesAnswer, 409, 413))
async def overlay_discontinuities(
    query: Annotated[queries.DiscontinuitiesQuery, Query()], show: Show
) -> Response:
    """The lines where irradiance breaks: what causes each, what it weighs, whether it is meshed."""
    return await show(query)


@router.get(f"{_ROOT}/triangulation", **_told(schemas.TriangulationAnswer, 409, 413))
async def overlay_triangulation(
    query: Annotated[queries.TriangulationQuery, Query()], show: Show
) -> Response:
    """The triangles that interpolants are based on, and which of their edges are discontinuities."""
    return await show(query)


@router.get(f"{_ROOT}/samples", **_told(schemas.SamplesAnswer, 409, 413))
async def overlay_samples(query: Annotated[queries.SamplesQuery, Query()], show: Show) -> Response:
    """Where interpolants are sampled, and what was found there."""
    return await show(query)


@router.get(f"{_ROOT}/graph", **_told(schemas.GraphAnswer, 409, 413))
async def overlay_graph(query: Annotated[queries.GraphQuery, Query()], show: Show) -> Response:
    """Irradiance as a surface over triangles: analytic, interpolated, or their difference."""
    return await show(query)


@router.get(f"{_ROOT}/probe", **_told(schemas.ProbeOverlayAnswer, 409, 413))
async def overlay_probe(query: Annotated[queries.ProbeQuery, Query()], show: Show) -> Response:
    """The light at one point of a surface: analytic, interpolated, and their difference."""
    return await show(query)


@router.get(f"{_ROOT}/backprojection", **_told(schemas.BackprojectionAnswer, 413))
async def overlay_backprojection(
    query: Annotated[queries.BackprojectionQuery, Query()], show: Show
) -> Response:
    """Sources as a point of a surface sees them: what is visible of each, what is hidden, and by what."""
    return await show(query)
