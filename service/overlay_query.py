"""The parameters of picks and overlays, as they come in a query, and what they ask of the engine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import StrEnum
from typing import Annotated, TypeAlias

from pydantic import ConfigDict, Field

from service.bounded_wait import BoundedWait
from service.camera_query import CameraQuery
from service.problems import INVALID, ProblemError
from solver.document.fields import MAX_COORDINATE
from solver.engine.overlays.backprojection import BackprojectionOverlay, Sources
from solver.engine.overlays.base import DEFAULT_LIMIT, MAX_LIMIT, Overlay, OverlayRequest, Page
from solver.engine.overlays.discontinuities import Activity, DiscontinuitiesOverlay
from solver.engine.overlays.elements import MeshColour, MeshOverlay
from solver.engine.overlays.files import OverlayFormat
from solver.engine.overlays.graph import MAX_RESOLUTION, GraphKind, GraphOverlay
from solver.engine.overlays.links import BlockersOverlay, LinkKind, LinksOverlay
from solver.engine.overlays.places import Address, Pixel, SurfacePoint
from solver.engine.overlays.probe import ProbeOverlay
from solver.engine.overlays.samples import SamplesOverlay
from solver.engine.overlays.selection import Selection
from solver.engine.overlays.triangles import TriangulationOverlay
from solver.engine.requests import CameraChoice

MOST_PIXELS: int = 2**31
"""Rows and columns of pixels are below this."""

_Id: TypeAlias = Annotated[int, Field(ge=0, lt=2**31)]
_Coordinate: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=-MAX_COORDINATE, le=MAX_COORDINATE)]


class PickQuery(CameraQuery):
    """Which pixel."""

    x: int = Field(ge=0, lt=MOST_PIXELS, description="Column of the pixel, 0 at the left.")
    y: int = Field(ge=0, lt=MOST_PIXELS, description="Row of the pixel, 0 at the top.")


class OverlayWait(StrEnum):
    """When an overlay is sent."""

    NONE = "none"
    CONVERGED = "converged"


class OverlayQuery(BoundedWait, ABC):
    """What every overlay may be asked with."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: OverlayFormat | None = Field(
        default=None,
        description="`json`, or `glb`: points, lines and triangles as binary glTF 2.0. By default what "
        "`Accept` says, or json.",
    )
    wait: OverlayWait = Field(
        default=OverlayWait.NONE,
        description="`none`: as soon as there is anything to show; `converged`: when the solution rests, and "
        "all that the camera sees is built, so that numbers of elements, links and triangles stay.",
    )

    @abstractmethod
    def overlay(self) -> Overlay:
        """What is to be shown. Raises ProblemError."""

    def view(self) -> CameraChoice:
        """Whose view fine light is made for."""
        return CameraChoice()

    def request(self) -> OverlayRequest:
        """What is asked of the engine. Raises ProblemError."""
        return OverlayRequest(self.overlay(), self.view(), self.wait is OverlayWait.CONVERGED)


class PagedQuery(OverlayQuery):
    """Of many items, which."""

    limit: int = Field(default=DEFAULT_LIMIT, ge=0, le=MAX_LIMIT, description="Items, at most.")
    offset: int = Field(default=0, ge=0, lt=2**31, description="Items left out before the first.")

    def page(self) -> Page:
        """The part that is shown."""
        return Page(self.limit, self.offset)


class SeenQuery(CameraQuery, OverlayQuery):
    """Of what a camera looks at first."""

    def view(self) -> CameraChoice:
        """The camera."""
        return self.choice()


class SelectionQuery(SeenQuery, PagedQuery):
    """Of which triangles."""

    triangle: _Id | None = Field(default=None, description="A triangle of the triangulation.")
    element: _Id | None = Field(default=None, description="All triangles of an element and its parts.")

    def selection(self) -> Selection:
        """The triangles. Raises ProblemError."""
        if self.triangle is not None and self.element is not None:
            message = "give either a triangle or an element"
            raise ProblemError.of_field(INVALID, ["query", "triangle"], message)
        return Selection(self.triangle, self.element)


class ScaledQuery(SeenQuery):
    """Irradiance as height."""

    scale: float | None = Field(
        default=None,
        allow_inf_nan=False,
        ge=0.0,
        le=MAX_COORDINATE,
        description="Height of a W/m2, in metres; by default as suits what is shown.",
    )


class MeshQuery(PagedQuery):
    """Which elements."""

    depth: int | None = Field(
        default=None,
        ge=0,
        le=64,
        description="Elements split so often, and the leaves above; 0: the patches. By default all leaves.",
    )
    element: _Id | None = Field(default=None, description="Only this element's parts.")
    colour: MeshColour = Field(default=MeshColour.RADIOSITY, description="`rho` is reflectance.")

    def overlay(self) -> Overlay:
        """The elements."""
        return MeshOverlay(self.depth, self.element, self.colour, self.page())


class LinksQuery(PagedQuery):
    """Which links."""

    element: _Id | None = Field(default=None, description="Only links with this end. By default all.")
    kind: LinkKind | None = Field(
        default=None,
        description="`full`, `partial` or `none` visibility, or `plane`: one end reaches through the plane "
        "of the other.",
    )

    def overlay(self) -> Overlay:
        """The links."""
        return LinksOverlay(self.element, self.kind, self.page())


class BlockersQuery(OverlayQuery):
    """Of which link."""

    link: _Id

    def overlay(self) -> Overlay:
        """The blockers."""
        return BlockersOverlay(self.link)


class DiscontinuitiesQuery(SeenQuery, PagedQuery):
    """Which discontinuities."""

    active: Activity = Field(
        default=Activity.ALL, description="`true`: those that the triangulation has edges along."
    )

    def overlay(self) -> Overlay:
        """The discontinuities."""
        return DiscontinuitiesOverlay(self.active, self.page())


class TriangulationQuery(SelectionQuery):
    """Which triangles."""

    def overlay(self) -> Overlay:
        """The triangles."""
        return TriangulationOverlay(self.selection(), self.page())


class SamplesQuery(SelectionQuery, ScaledQuery):
    """Which samples."""

    def overlay(self) -> Overlay:
        """The samples."""
        return SamplesOverlay(self.selection(), self.scale, self.page())


class GraphQuery(SelectionQuery, ScaledQuery):
    """Which graph."""

    kind: GraphKind = Field(
        default=GraphKind.ANALYTIC, description="`difference` is analytic less interpolated."
    )
    resolution: int | None = Field(
        default=None,
        ge=1,
        le=MAX_RESOLUTION,
        description="Steps along the sides of each triangle; by default the more, the larger its share of "
        "its patch.",
    )

    def overlay(self) -> Overlay:
        """The graph. Raises ProblemError."""
        chosen = self.selection()
        if not chosen.is_given:
            message = "a graph is over a triangle or an element: give one"
            raise ProblemError.of_field(INVALID, ["query", "triangle"], message)
        return GraphOverlay(chosen, self.kind, self.resolution, self.scale, self.page())


class PlaceQuery(SeenQuery):
    """Which point."""

    x: _Coordinate = Field(description="With `z`: metres. Without: a pixel's column, 0 at the left.")
    y: _Coordinate = Field(description="With `z`: metres. Without: a pixel's row, 0 at the top.")
    z: _Coordinate | None = Field(
        default=None, description="Metres: the point is on a surface. Without it a pixel is meant."
    )
    patch: _Id | None = Field(
        default=None, description="Where surfaces touch at the point: which is meant. By default a front."
    )

    def place(self) -> Address:
        """The point. Raises ProblemError."""
        if self.z is not None:
            return SurfacePoint(self.x, self.y, self.z, self.patch)
        if self.patch is not None:
            message = "a pixel shows a patch; one can be given with x, y and z only"
            raise ProblemError.of_field(INVALID, ["query", "patch"], message)
        for name, value in (("x", self.x), ("y", self.y)):
            if not (value.is_integer() and 0 <= value < MOST_PIXELS):
                message = "without z this is a pixel, and a whole number that is not negative"
                raise ProblemError.of_field(INVALID, ["query", name], message)
        return Pixel(int(self.x), int(self.y))


class BackprojectionQuery(PlaceQuery, PagedQuery):
    """From where, and on to what."""

    sources: Sources = Field(default=Sources.EMITTING, description="`all`: whatever faces the point.")

    def overlay(self) -> Overlay:
        """The backprojection. Raises ProblemError."""
        return BackprojectionOverlay(self.place(), self.sources, self.page())


class ProbeQuery(PlaceQuery, ScaledQuery):
    """Where to measure."""

    def overlay(self) -> Overlay:
        """The measurement. Raises ProblemError."""
        return ProbeOverlay(self.place(), self.scale)
