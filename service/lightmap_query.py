"""The parameters of a lightmap, as they come in a query, and what they ask of the engine."""

from __future__ import annotations

from pydantic import ConfigDict, Field

from service.bounded_wait import BoundedWait
from service.overlay_query import OverlayWait
from solver.engine.lightmaps.bake import Gather, LightmapRequest, LightmapSource
from solver.engine.lightmaps.files import LightmapFormat


class LightmapQuery(BoundedWait):
    """How fine, by which light, and as what."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    density: float | None = Field(
        default=None,
        gt=0.0,
        le=1e9,
        allow_inf_nan=False,
        description="Texels per metre, at least; by default as many as make some 500 by 500 texels.",
    )
    source: LightmapSource = Field(
        default=LightmapSource.VPL,
        description="`vpl`: virtual point lights, straight from the scene; `radiosity`: the solution, once "
        "it rests.",
    )
    gather: Gather = Field(
        default=Gather.AUTO,
        description="With `source=radiosity`: `exact` gathers at every texel, `solution` shows the "
        "solution's own functions, `auto` is exact up to 65,536 texels. `X-Method` tells which it was.",
    )
    format: LightmapFormat | None = Field(
        default=None,
        description="`glb`: the scene with the picture as a texture; `exr`: irradiance in W/m2; `png`: the "
        "picture alone, sRGB. By default what `Accept` says, or glb.",
    )
    white: float | None = Field(
        default=None,
        ge=1e-30,
        le=1e30,
        allow_inf_nan=False,
        description="W/m2 of irradiance that the picture shows white; by default what one texel in a "
        "thousand exceeds.",
    )
    wait: OverlayWait = Field(
        default=OverlayWait.CONVERGED,
        description="`converged`: when it is within the tolerance of the settings, or cannot be improved; "
        "`none`: as soon as all texels have a first estimate.",
    )

    def request(self) -> LightmapRequest:
        """What is asked of the engine."""
        return LightmapRequest(self.density, self.source, self.gather)
