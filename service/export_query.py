"""The parameters of exports and grids, as they come in a query, and what they ask of the engine."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

from service.bounded_wait import BoundedWait
from service.camera_query import PointText, triple_of
from service.overlay_query import OverlayWait
from solver.document.fields import MAX_COORDINATE
from solver.engine.exports.files import ExportFormat, ExportRequest, Shading
from solver.engine.grids import GridRequest


class ExportQuery(BoundedWait):
    """What file, and when."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: ExportFormat = Field(
        default=ExportFormat.GLB,
        description="`glb`: binary glTF; `npz`: the elements of the solution as arrays of numpy; `vtu`: the "
        "same for ParaView; `json`: the scene document.",
    )
    shading: Shading = Field(
        default=Shading.LIGHT,
        description="Of glb: `light`, the solution as colours of the elements' vertices; `materials`, what "
        "surfaces are made of, for programs that light them by themselves. `GET …/lightmap` has the "
        "light as a texture.",
    )
    wait: OverlayWait = Field(
        default=OverlayWait.NONE,
        description="`none`: with the light as far as it has come; `converged`: when the solution rests.",
    )

    def request(self) -> ExportRequest:
        """What is asked of the engine."""
        return ExportRequest(self.format, self.shading)


class GridQuery(BoundedWait):
    """Where to measure, and when."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    spacing: float = Field(
        ge=1e-9,
        le=MAX_COORDINATE,
        allow_inf_nan=False,
        description="Metres between points, at most: a face is divided evenly, with points in the middles.",
    )
    object: str | None = Field(
        default=None, min_length=1, max_length=200, description="An object, on whose faces to measure."
    )
    face: Annotated[int, Field(ge=0, lt=2**31)] | None = Field(
        default=None, description="One face of it alone."
    )
    origin: PointText | None = Field(
        default=None, description="In place of an object: a corner of a parallelogram, x,y,z in metres."
    )
    u: PointText | None = Field(default=None, description="One side of it, from that corner.")
    v: PointText | None = Field(
        default=None, description="The other side. What is measured arrives from where u x v points to."
    )
    offset: float = Field(
        default=0.0,
        ge=-MAX_COORDINATE,
        le=MAX_COORDINATE,
        allow_inf_nan=False,
        description="Metres by which points are lifted off their plane.",
    )
    back: bool = Field(default=False, description="Measure on the other side.")
    wait: OverlayWait = Field(
        default=OverlayWait.NONE,
        description="`none`: by the light as far as it has come; `converged`: when the solution rests.",
    )

    def request(self, most: int) -> GridRequest:
        """What is asked of the engine, for at most so many points."""
        return GridRequest(
            spacing=self.spacing,
            object=self.object,
            face=self.face,
            origin=None if self.origin is None else triple_of(self.origin),
            u=None if self.u is None else triple_of(self.u),
            v=None if self.v is None else triple_of(self.v),
            offset=self.offset,
            back=self.back,
            most=most,
        )
