"""The parameters of a camera, as they come in a query: one of the scene, or one given there."""

from __future__ import annotations

import math
from typing import Annotated, Final, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from solver.document.fields import LEAST_FIELD_OF_VIEW, LEAST_LENGTH, MAX_COORDINATE
from solver.engine.requests import CameraChoice

_NUMBER: Final = r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?"

_Triple: TypeAlias = tuple[float, float, float]


def triple_of(text: str) -> _Triple:
    """The numbers of a text like 1,2,3. Raises PydanticCustomError."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise PydanticCustomError("not_a_triple", "three numbers are needed, as in 1,2,3") from None
    if not max(abs(x), abs(y), abs(z)) <= MAX_COORDINATE or not all(map(math.isfinite, (x, y, z))):
        raise PydanticCustomError("out_of_bounds", f"each number must be within {MAX_COORDINATE:g} of 0")
    return x, y, z


def _point(text: str) -> str:
    triple_of(text)
    return text


def _direction(text: str) -> str:
    if max(map(abs, triple_of(text))) < LEAST_LENGTH:
        raise PydanticCustomError("zero_vector", "a direction of length 0 points nowhere")
    return text


_AsTriple = WithJsonSchema(
    {"type": "string", "pattern": f"^{_NUMBER},{_NUMBER},{_NUMBER}$", "examples": ["1,2,3"]}
)
# Texts, since FastAPI takes a parameter of a sequence type to be one that is given several times.
PointText: TypeAlias = Annotated[str, AfterValidator(_point), _AsTriple]
"""x,y,z in metres."""
DirectionText: TypeAlias = Annotated[str, AfterValidator(_direction), _AsTriple]
"""x,y,z of any length but 0."""


class CameraQuery(BaseModel):
    """From where to look."""

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

    def choice(self) -> CameraChoice:
        """The camera."""
        return CameraChoice(
            name=self.camera,
            eye=None if self.eye is None else triple_of(self.eye),
            target=None if self.target is None else triple_of(self.target),
            up=None if self.up is None else triple_of(self.up),
            vertical_fov=self.vertical_fov,
            width=self.width,
            height=self.height,
        )
