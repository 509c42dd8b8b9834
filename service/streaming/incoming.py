"""What a client says on a stream: JSON objects, told apart by their `type`."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field, TypeAdapter, ValidationError

from service.json_body import parse_json
from service.problems import INVALID, ProblemError
from service.schemas import EditBatch
from solver.document.fields import Closed, Direction, Extent, FieldOfView, Identifier, Number, Point
from solver.engine.requests import CameraChoice, Encoding, FrameRequest, LayerName, RendererName
from solver.rendering.encoding import PictureFormat
from solver.rendering.tone_mapping import ToneCurve

SOURCE: Final = "message"
"""Where the fields that problems name are found"""


class _Named(Closed):
    id: Annotated[str, Field(strict=True, max_length=200)] | None = Field(
        default=None, description="The client's own name of the message: what answers it repeats it."
    )


class CameraMessage(_Named):
    """What to show from now on, in place of what was asked for before."""

    type: Literal["camera"]
    camera: Identifier | None = Field(
        default=None,
        description="A camera of the scene; by default `main` or the first. What follows replaces its parts.",
    )
    eye: Point | None = None
    target: Point | None = None
    up: Direction | None = None
    vertical_fov: FieldOfView | None = None
    width: Extent | None = None
    height: Extent | None = None
    renderer: RendererName | None = None
    layer: LayerName = LayerName.RADIANCE
    samples: Extent = 1
    format: PictureFormat = Field(
        default=PictureFormat.JPEG, description="At rest, `webp` and `png` are without loss."
    )
    exposure: Annotated[Number, Field(ge=-64.0, le=64.0)] | Literal["auto"] = "auto"
    tone_map: ToneCurve = ToneCurve.LINEAR
    scale_maximum: Annotated[Number, Field(gt=0.0, le=1e15)] | Literal["auto"] = Field(
        default="auto", description="Lux at the end of the scale of the layer `false_colour`."
    )

    @property
    def frame(self) -> FrameRequest:
        """What is to be drawn."""
        choice = CameraChoice(
            name=self.camera,
            eye=_triple(self.eye),
            target=_triple(self.target),
            up=_triple(self.up),
            vertical_fov=self.vertical_fov,
            width=self.width,
            height=self.height,
        )
        return FrameRequest(choice, self.renderer, self.layer, self.samples)

    @property
    def encoding(self) -> Encoding:
        """How it is to be turned into a file."""
        return Encoding(self.format, None if self.exposure == "auto" else self.exposure, self.tone_map)

    @property
    def lux(self) -> float | None:
        """The end of the scale of false colours; None: as suits what is seen."""
        return None if self.scale_maximum == "auto" else self.scale_maximum


class EditsMessage(_Named, EditBatch):
    """Edits that are applied all, in their order, or not at all."""

    type: Literal["edits"]


class UndoMessage(_Named):
    """Take back the newest edit batch."""

    type: Literal["undo"]


class RedoMessage(_Named):
    """Bring back the batch that was taken back last."""

    type: Literal["redo"]


class AckMessage(_Named):
    """A frame has arrived, and all before it."""

    type: Literal["ack"]
    number: Annotated[int, Field(strict=True, ge=1, lt=2**53)]


class PingMessage(_Named):
    """The client is there, and wants to hear that the service is."""

    type: Literal["ping"]


Incoming: TypeAlias = CameraMessage | EditsMessage | UndoMessage | RedoMessage | AckMessage | PingMessage

_INCOMING: Final[TypeAdapter[Incoming]] = TypeAdapter(Annotated[Incoming, Field(discriminator="type")])


def parse(text: bytes) -> tuple[str | None, Incoming | ProblemError]:
    """The id that a message gives itself, and the message, or what is wrong with it."""
    try:
        value = parse_json(text)
    except ValueError as error:
        return None, ProblemError.of_field(INVALID, [SOURCE], f"not acceptable JSON: {error}")
    name = value.get("id") if isinstance(value, dict) else None
    try:
        message = _INCOMING.validate_python(value)
    except ValidationError as error:
        told = name if isinstance(name, str) and len(name) <= 200 else None
        return told, ProblemError.of_fields([_located(found) for found in error.errors()])
    return message.id, message


def _located(found: object) -> dict[str, object]:
    """An error of pydantic's, located from the message on, without the branch of the union."""
    error = dict(found)  # type: ignore[call-overload]
    if error["type"].startswith("union_tag") and not error["loc"]:
        return {"type": "value_error", "loc": (SOURCE, "type"), "msg": error["msg"]}
    return {**error, "loc": (SOURCE, *error["loc"][1:])}


def _triple(vector: list[float] | None) -> tuple[float, float, float] | None:
    return None if vector is None else (vector[0], vector[1], vector[2])
