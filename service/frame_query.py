"""The parameters of a frame, as they come in a query, and what they ask of the engine."""

from __future__ import annotations

import math
import re
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import BeforeValidator, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from service.bounded_wait import BoundedWait
from service.camera_query import CameraQuery
from service.negotiation import FrameFormat
from solver.engine.requests import (
    Encoding,
    FrameRequest,
    LayerName,
    RendererName,
    Wait,
    WaitFor,
)
from solver.rendering.tone_mapping import ToneCurve

_MAX_ERROR: Final = re.compile(r"max_error=(\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)")


def _wait(text: object) -> object:
    if not isinstance(text, str):
        return text
    if text in (WaitFor.NONE, WaitFor.CONVERGED):
        return Wait(WaitFor(text))
    found = _MAX_ERROR.fullmatch(text)
    if found is None:
        raise PydanticCustomError("unknown_wait", "none, converged or max_error=<number> is needed")
    return Wait(WaitFor.MAX_ERROR, float(found[1]))


WaitText: TypeAlias = Annotated[
    Wait,
    BeforeValidator(_wait),
    WithJsonSchema({"type": "string", "pattern": r"^(none|converged|max_error=\d+(\.\d+)?)$"}),
]


class FrameQuery(CameraQuery, BoundedWait):
    """What to show, how, and when."""

    renderer: RendererName | None = Field(
        default=None,
        description="How it is drawn; by default by interpolants. `auto`: by whichever has the least "
        "estimated error by then, which `X-Renderer` tells; that is the default where there is a budget.",
    )
    format: FrameFormat | None = Field(
        default=None,
        description="`png`, `jpeg` and `webp` hold tone-mapped sRGB; `exr`, `hdr` and `npy` linear numbers, "
        "`npy` as float32 (height, width, 3), top row first. By default what `Accept` says, or png.",
    )
    exposure: Annotated[float, Field(allow_inf_nan=False, ge=-64.0, le=64.0)] | Literal["auto"] = Field(
        default="auto", description="Stops, for pictures of radiance."
    )
    tone_map: ToneCurve = Field(default=ToneCurve.LINEAR, description="For pictures of radiance.")
    layer: LayerName = Field(
        default=LayerName.RADIANCE,
        description="What a pixel shows. `triangle`, `barycentric` and `error` are those of interpolants.",
    )
    samples: int = Field(default=1, ge=1, lt=2**31, description="Samples of a pixel, for antialiasing.")
    wait: WaitText = Field(
        default=Wait(),
        description="`none`: the best frame now; `converged`: when it is within the tolerance; "
        "`max_error=0.02`: when its error estimate is at most that.",
    )
    timeout_ms: float | None = Field(
        default=None,
        ge=0.0,
        allow_inf_nan=False,
        description="Bounds every wait; then the best frame comes, with `X-Converged: false`. The service "
        "has a bound of its own, ten minutes unless configured otherwise.",
    )
    budget_ms: float | None = Field(
        default=None,
        ge=0.0,
        allow_inf_nan=False,
        description="The best frame that so much time allows, drawing and encoding included: by whichever "
        "renderer has the least estimated error by then, unless one is named. It comes sooner only if it is "
        "as good as `wait` asks, or within the tolerance.",
    )

    def frame(self) -> FrameRequest:
        """What is to be drawn."""
        max_error = self.wait.max_error if self.wait.until is WaitFor.MAX_ERROR else math.inf
        renderer = self.renderer
        if renderer is None and self.budget_ms is not None:
            renderer = RendererName.AUTO
        return FrameRequest(self.choice(), renderer, self.layer, self.samples, max_error)

    def encoding(self, chosen: FrameFormat) -> Encoding:
        """How it is to be turned into a file of that format."""
        exposure = None if self.exposure == "auto" else self.exposure
        return Encoding(chosen, exposure, self.tone_map)

    def waiting(self) -> Wait:
        """How good it is to be."""
        if self.budget_ms is not None and self.wait.until is WaitFor.NONE:
            return Wait(WaitFor.CONVERGED)
        return self.wait

    def longest(self, most_ms: float) -> float:
        """Seconds that it may wait, where the service allows `most_ms`."""
        return super().longest(most_ms if self.budget_ms is None else min(self.budget_ms, most_ms))
