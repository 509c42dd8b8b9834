"""The parameters of a frame, as they come in a query, and what they ask of the engine."""

from __future__ import annotations

import math
import re
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from service.negotiation import FrameFormat
from solver.document.fields import LEAST_FIELD_OF_VIEW, LEAST_LENGTH, MAX_COORDINATE
from solver.engine.requests import (
    CameraChoice,
    Encoding,
    FrameRequest,
    LayerName,
    RendererName,
    Wait,
    WaitFor,
)
from solver.rendering.tone_mapping import ToneCurve

_MAX_ERROR: Final = re.compile(r"max_error=(\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)")
_NUMBER: Final = r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?"

_Triple: TypeAlias = tuple[float, float, float]


def _triple(text: str) -> _Triple:
    """The numbers of a text like 1,2,3. Raises PydanticCustomError."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise PydanticCustomError("not_a_triple", "three numbers are needed, as in 1,2,3") from None
    if not max(abs(x), abs(y), abs(z)) <= MAX_COORDINATE or not all(map(math.isfinite, (x, y, z))):
        raise PydanticCustomError("out_of_bounds", f"each number must be within {MAX_COORDINATE:g} of 0")
    return x, y, z


def _point(text: str) -> str:
    _triple(text)
    return text


def _direction(text: str) -> str:
    if max(map(abs, _triple(text))) < LEAST_LENGTH:
        raise PydanticCustomError("zero_vector", "a direction of length 0 points nowhere")
    return text


def _wait(text: object) -> object:
    if not isinstance(text, str):
        return text
    if text in (WaitFor.NONE, WaitFor.CONVERGED):
        return Wait(WaitFor(text))
    found = _MAX_ERROR.fullmatch(text)
    if found is None:
        raise PydanticCustomError("unknown_wait", "none, converged or max_error=<number> is needed")
    return Wait(WaitFor.MAX_ERROR, float(found[1]))


_AsTriple = WithJsonSchema(
    {"type": "string", "pattern": f"^{_NUMBER},{_NUMBER},{_NUMBER}$", "examples": ["1,2,3"]}
)
# Texts, since FastAPI takes a parameter of a sequence type to be one that is given several times.
PointText: TypeAlias = Annotated[str, AfterValidator(_point), _AsTriple]
"""x,y,z in metres."""
DirectionText: TypeAlias = Annotated[str, AfterValidator(_direction), _AsTriple]
"""x,y,z of any length but 0."""
WaitText: TypeAlias = Annotated[
    Wait,
    BeforeValidator(_wait),
    WithJsonSchema({"type": "string", "pattern": r"^(none|converged|max_error=\d+(\.\d+)?)$"}),
]


class FrameQuery(BaseModel):
    """What to show, how, and when."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    camera: str | None = Field(
        default=None,
        min_length=1,
        max_length=200,
        description="A camera of the scene; by default `main` or the first. What follows replaces its parts.",
    )
    eye: PointText | None = Field(default=None, description="Where the camera stands, x,y,z in metres.")
    target: PointText | None = Field(default=None, description="What is in the middle of the frame.")
    up: DirectionText | None = Field(default=None, description="The direction that is up in the frame.")
    vertical_fov: float | None = Field(
        default=None,
        allow_inf_nan=False,
        ge=LEAST_FIELD_OF_VIEW,
        lt=180.0,
        description="Full vertical angle of view, degrees.",
    )
    width: int | None = Field(default=None, ge=1, lt=2**31, description="Pixels.")
    height: int | None = Field(default=None, ge=1, lt=2**31, description="Pixels.")
    renderer: RendererName | None = Field(
        default=None,
        description="How it is drawn; by default the best that there is, which `X-Renderer` tells. "
        "`interpolant`, `vpl` and `gather` are not available yet.",
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
        description="What a pixel shows. `triangle`, `barycentric`, `error` and `false_colour` are not "
        "available yet.",
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

    def frame(self) -> FrameRequest:
        """What is to be drawn."""
        camera = CameraChoice(
            name=self.camera,
            eye=None if self.eye is None else _triple(self.eye),
            target=None if self.target is None else _triple(self.target),
            up=None if self.up is None else _triple(self.up),
            vertical_fov=self.vertical_fov,
            width=self.width,
            height=self.height,
        )
        max_error = self.wait.max_error if self.wait.until is WaitFor.MAX_ERROR else math.inf
        return FrameRequest(camera, self.renderer, self.layer, self.samples, max_error)

    def encoding(self, chosen: FrameFormat) -> Encoding:
        """How it is to be turned into a file of that format."""
        exposure = None if self.exposure == "auto" else self.exposure
        return Encoding(chosen, exposure, self.tone_map)

    def waiting(self) -> Wait:
        """How good it is to be."""
        return self.wait
