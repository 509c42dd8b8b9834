"""Field types of the scene document: finite JSON numbers, points, colours, and what a field may hold.

Numbers are strict (no strings, no booleans) and bounded, so that no product of them that the solver
forms can overflow.
"""

from __future__ import annotations

from typing import Annotated, Final, TypeAlias

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

MAX_COORDINATE: Final = 1e9
"""Metres: farther than the Moon."""

MAX_EMISSION: Final = 1e12
"""W/m2: four orders of magnitude above the surface of the Sun."""

LEAST_LENGTH: Final = 1e-100
"""Shorter vectors, and quaternions, have no direction: their squares lose their digits, or are 0."""

LEAST_FIELD_OF_VIEW: Final = 1e-3
"""Degrees: 17 mm seen from a kilometre."""

MAX_EXPONENT: Final = 1e6
"""Of a power of a cosine: half of the light is then within a fifteenth of a degree."""

MAX_FACE_CORNERS: Final = 4096

_LEAST_DETERMINANT: Final = 1e-12
"""A matrix is singular if its determinant over the product of its rows' lengths is at most this."""


class Closed(BaseModel):
    """A model that refuses unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _triple(number: object) -> object:
    return [number] * 3 if isinstance(number, int | float) and not isinstance(number, bool) else number


def _nonzero_parts(scale: list[float]) -> list[float]:
    if any(part == 0.0 for part in scale):
        raise PydanticCustomError("zero_scale", "a scale of 0 flattens the object")
    return scale


def _has_length(rotation: list[float]) -> list[float]:
    if float(np.linalg.norm(rotation)) < LEAST_LENGTH:
        raise PydanticCustomError("zero_quaternion", "a quaternion of length 0 is not a rotation")
    return rotation


def _affine(matrix: list[float]) -> list[float]:
    if matrix[12:] != [0.0, 0.0, 0.0, 1.0]:
        raise PydanticCustomError("not_affine", "the last row must be 0, 0, 0, 1")
    linear = np.array(matrix).reshape(4, 4)[:3, :3]
    lengths = np.linalg.norm(linear, axis=1)
    if not lengths.all() or abs(np.linalg.det(linear / lengths[:, None])) <= _LEAST_DETERMINANT:
        raise PydanticCustomError("singular_matrix", "the matrix has no inverse: it flattens the object")
    return matrix


def _distinct_from_zero(vector: list[float]) -> list[float]:
    if max(map(abs, vector)) < LEAST_LENGTH:
        raise PydanticCustomError("zero_vector", "a direction of length 0 points nowhere")
    return vector


Number: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Coordinate: TypeAlias = Annotated[
    float, Field(strict=True, allow_inf_nan=False, ge=-MAX_COORDINATE, le=MAX_COORDINATE)
]
Point: TypeAlias = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]
"""x, y, z in metres."""
Direction: TypeAlias = Annotated[Point, AfterValidator(_distinct_from_zero)]
"""x, y, z of any length but 0."""
Reflectance: TypeAlias = Annotated[
    list[Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, lt=1.0)]],
    Field(min_length=3, max_length=3),
]
Emission: TypeAlias = Annotated[
    list[Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=MAX_EMISSION)]],
    Field(min_length=3, max_length=3),
]
Exponent: TypeAlias = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=MAX_EXPONENT)]
"""The power of a cosine: 0 spreads light over a hemisphere, large ones hold it together."""
Quaternion: TypeAlias = Annotated[
    list[Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e6, le=1e6)]],
    Field(min_length=4, max_length=4),
    AfterValidator(_has_length),
]
Scale: TypeAlias = Annotated[
    list[Coordinate],
    Field(min_length=3, max_length=3),
    BeforeValidator(_triple, json_schema_input_type=Coordinate | Point),
    AfterValidator(_nonzero_parts),
]
Matrix: TypeAlias = Annotated[list[Coordinate], Field(min_length=16, max_length=16), AfterValidator(_affine)]
Index: TypeAlias = Annotated[int, Field(strict=True, ge=0, lt=2**31)]
Face: TypeAlias = Annotated[list[Index], Field(min_length=3, max_length=MAX_FACE_CORNERS)]
Identifier: TypeAlias = Annotated[str, Field(strict=True, min_length=1, max_length=200)]
FieldOfView: TypeAlias = Annotated[
    float, Field(strict=True, allow_inf_nan=False, ge=LEAST_FIELD_OF_VIEW, lt=180.0)
]
Extent: TypeAlias = Annotated[int, Field(strict=True, ge=1, lt=2**31)]
"""Pixels; how many may be asked for is the host's limit."""

Location: TypeAlias = tuple[str | int, ...]
"""Path of a field in a document, as in ("objects", 2, "mesh", "faces", 0, 1)."""
