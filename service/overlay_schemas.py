"""What overlays are answered with.

They are tables: each list holds one value an item, and all are of one length, `count`. Lengths are in
metres, areas in m2, irradiance and radiosity in W/m2 as R, G, B; what is unknown, or without bound, is null.
Corners of triangles among quadrilaterals come with their last one twice, and `corner_count` 3.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

from service.schemas import Triple

_Pair: TypeAlias = Annotated[list[float], Field(min_length=2, max_length=2)]
_Ends: TypeAlias = Annotated[list[Triple], Field(min_length=2, max_length=2)]
_Triangle: TypeAlias = Annotated[list[Triple], Field(min_length=3, max_length=3)]
_Quadrilateral: TypeAlias = Annotated[list[Triple], Field(min_length=4, max_length=4)]
_Visibility: TypeAlias = Literal["full", "partial", "none"]


class OverlayLink(BaseModel):
    """An overlay that there is."""

    name: str
    href: str
    shows: str


class OverlayList(BaseModel):
    """The overlays of a session."""

    revision: int
    overlays: list[OverlayLink]


class Table(BaseModel):
    """What all overlays tell."""

    model_config = ConfigDict(extra="forbid")

    overlay: str
    revision: int
    total: int = Field(description="Items that there are.")
    count: int = Field(description="Items that are shown: those from `offset` on, `limit` at most.")
    objects: list[str] = Field(description="Ids of the scene's objects: others refer to them by index.")


class _OfSolution(Table):
    solution: int = Field(
        description="Counts the solution's steps. Elements keep their numbers, links until the next step."
    )


class MeshAnswer(_OfSolution):
    """Elements of the hierarchy, which tile the surfaces."""

    colour: Literal["radiosity", "rho"]
    colour_scale: float = Field(description="What is drawn as 1.")
    element: list[int]
    parent: list[int | None] = Field(description="The element that it is a part of; null for a patch.")
    depth: list[int]
    leaf: list[bool]
    patch: list[int]
    object: list[int]
    face: list[int]
    corners: list[_Quadrilateral]
    corner_count: list[int]
    area: list[float]
    radiosity: list[Triple] = Field(description="Mean, emission included.")
    reflectance: list[Triple]
    rgb: list[Triple] = Field(description="The colour that it is drawn in.")


class LinkCounts(BaseModel):
    """Links of each visibility class, of whatever kind is shown."""

    model_config = ConfigDict(extra="forbid")

    full: int
    partial: int
    none: int


class LinksAnswer(_OfSolution):
    """Links: white, or green where part is hidden, or pink where an end reaches through the other's plane."""

    counts: LinkCounts
    link: list[int]
    p: list[int] = Field(description="Element at one end.")
    q: list[int] = Field(description="Element at the other.")
    object_p: list[int]
    object_q: list[int]
    ends: list[_Ends] = Field(description="Their middles.")
    visibility: list[_Visibility]
    crosses_plane: list[bool] = Field(description="Whether one end reaches through the plane of the other.")
    form_factor_pq: list[float] = Field(description="Of p to q, as far as it is visible.")
    form_factor_qp: list[float]
    exchange: list[float] = Field(description="Either form factor times its element's area.")
    visible_fraction: list[float]
    samples: list[int] = Field(description="Rays behind that; 0 where it is exact.")
    blockers: list[int] = Field(description="Patches that may stand between.")
    rgb: list[Triple]


class LinkEnd(BaseModel):
    """One end of a link."""

    model_config = ConfigDict(extra="forbid")

    element: int
    patch: int
    object: int
    corners: list[Triple]
    form_factor: float = Field(description="To the other end.")


class BlockersAnswer(_OfSolution):
    """What may stand between the ends of a link."""

    link: int
    visibility: _Visibility
    visible_fraction: float
    samples: int
    exchange: float
    ends: Annotated[list[LinkEnd], Field(min_length=2, max_length=2)]
    patch: list[int]
    object: list[int]
    face: list[int]
    corners: list[_Quadrilateral]
    corner_count: list[int]


class DiscontinuityCounts(BaseModel):
    """What became of the discontinuities."""

    model_config = ConfigDict(extra="forbid")

    found: int
    active: int
    dropped_by_weight: int
    dropped_by_limit: int


class DiscontinuitiesAnswer(Table):
    """Discontinuities of irradiance on receivers, violet."""

    counts: DiscontinuityCounts
    discontinuity: list[int]
    kind: list[Literal["VE", "EV", "horizon", "contact", "graze"]]
    ends: list[_Ends]
    receiver: list[int] = Field(description="Patch that it lies on.")
    source: list[int | None] = Field(description="Patch whose light it breaks; null for a contact.")
    blocker: list[int | None] = Field(description="Patch that breaks it; null for a horizon.")
    receiver_object: list[int]
    source_object: list[int | None]
    blocker_object: list[int | None]
    set: list[int] = Field(description="Those of a set lie on one line.")
    jump: list[bool] = Field(description="Whether irradiance itself may jump, or only a derivative.")
    weight: list[float | None] = Field(
        description="W/m2 of luminance that interpolants may be wrong by without it; null for a contact."
    )
    hardt_weight: list[float | None] = Field(
        description="Greatest quotient of the distances source to blocker and blocker to receiver, times the "
        "source's luminance of radiosity in W/m2; null for a contact."
    )
    active: list[bool] = Field(description="Whether the triangulation has edges along it.")


class TriangulationAnswer(Table):
    """Triangles that carry interpolants; edges along discontinuities violet, others green."""

    edges: int = Field(description="Edges of the triangles that are shown, each once.")
    triangle: list[int]
    element: list[int]
    cell: list[int]
    patch: list[int]
    object: list[int]
    face: list[int]
    vertices: list[Annotated[list[int], Field(min_length=3, max_length=3)]]
    corners: list[_Triangle]
    area: list[float]
    edge_is_discontinuity: list[Annotated[list[bool], Field(min_length=3, max_length=3)]] = Field(
        description="Edge k runs from corner k to the next."
    )
    edge_is_jump: list[Annotated[list[bool], Field(min_length=3, max_length=3)]]
    edge_set: list[Annotated[list[int | None], Field(min_length=3, max_length=3)]]
    neighbour: list[Annotated[list[int | None], Field(min_length=3, max_length=3)]] = Field(
        description="Triangle of the same patch across each edge."
    )
    exact: list[bool] = Field(description="Whether all its samples are point irradiances.")
    error: list[float] = Field(description="Estimated RMS error of the luminance of irradiance, W/m2.")


class SamplesAnswer(Table):
    """Samples of interpolants, yellow, as high as their luminance."""

    height_scale: float = Field(description="Metres for a W/m2.")
    sample: list[int]
    triangle: list[int] = Field(description="One that the sample belongs to.")
    element: list[int]
    patch: list[int]
    object: list[int]
    position: list[Triple]
    irradiance: list[Triple]
    luminance: list[float]
    height: list[float]
    exact: list[bool] = Field(description="A point irradiance, and not yet the solution's own function.")


class GraphAnswer(Table):
    """Irradiance over triangles as a grid: analytic white, interpolated blue, the difference red."""

    kind: Literal["analytic", "interpolated", "difference"]
    height_scale: float = Field(description="Metres for a W/m2.")
    triangles: list[int] = Field(description="All that the graph is over.")
    resolution: list[int] = Field(description="Steps along the sides of each of these.")
    lines: list[Annotated[list[int], Field(min_length=2, max_length=2)]] = Field(
        description="Points that are neighbours, by their place in the lists."
    )
    triangle: list[int]
    st: list[_Pair] = Field(description="Place on the triangle: corner 0 + s (1 - 0) + t (2 - 0).")
    position: list[Triple] = Field(description="On the surface.")
    irradiance: list[Triple]
    luminance: list[float]
    height: list[float] = Field(description="Along the front's normal.")


class ProbeOverlayAnswer(Table):
    """The light at one point of a surface."""

    height_scale: float
    position: list[Triple]
    normal: list[Triple]
    object: list[int]
    face: list[int]
    patch: list[int]
    element: list[int]
    triangle: list[int]
    barycentric: list[Triple]
    analytic: list[Triple] = Field(description="Point irradiance by the settled solution.")
    interpolated: list[Triple] = Field(description="By the triangle's interpolant.")
    difference: list[Triple] = Field(description="Analytic less interpolated.")
    illuminance: list[float] = Field(description="lux, analytic")
    illuminance_interpolated: list[float] = Field(description="lux")
    exact_samples: list[bool] = Field(description="Whether all the interpolant's samples are exact.")


class BackprojectionAnswer(Table):
    """Sources as a point sees them: visible parts white, edges of blockers violet, other lines green."""

    position: Triple
    normal: Triple
    receiver: int = Field(description="Patch that the point lies on.")
    element: int
    sources: Literal["emitting", "all"]
    patch: list[int]
    object: list[int]
    face: list[int]
    corners: list[_Quadrilateral] = Field(description="Of the whole source.")
    corner_count: list[int]
    emits: list[bool]
    area_above_horizon: list[float] = Field(description="Of its part before the point's own surface.")
    visible_fraction: list[float] = Field(description="Share of that area.")
    form_factor: list[float] = Field(description="From the point to what is visible.")
    form_factor_unoccluded: list[float] = Field(description="If nothing stood between.")
    visible: list[list[Annotated[list[Triple], Field(min_length=3)]]] = Field(
        description="Convex polygons that tile what is visible."
    )
    hidden: list[list[_Triangle]] = Field(description="Triangles that tile what is not.")
