"""The scene document, version 1: what a client posts and gets, and what a scene file holds.

The models check each field by itself; `solver.document.conversion` checks how fields relate
(indices against vertices, ids against one another) and turns a document into a `Scene`.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from solver.document.fields import (
    Closed,
    Direction,
    Emission,
    Exponent,
    Extent,
    Face,
    FieldOfView,
    Identifier,
    Matrix,
    Point,
    Quaternion,
    Reflectance,
    Scale,
)


class MeshDocument(Closed):
    """Planar polygons over shared vertices, in the object's own frame."""

    vertices: list[Point] = Field(description="Points x, y, z in metres.")
    faces: list[Face] = Field(
        description="Vertex indices of each polygon, counter-clockwise seen from its front. Polygons may be "
        "concave; one that is not planar is triangulated; one without area is dropped with a warning."
    )

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"vertices": [[0, 0, 2], [0, 1, 2], [1, 1, 2], [1, 0, 2]], "faces": [[0, 1, 2, 3]]}]
        }
    )


class MaterialDocument(Closed):
    """A surface: diffuse, and specular where it says so. Triples are linear RGB with sRGB/Rec.709 primaries.

    In each channel, reflectance + specular is below 1.
    """

    reflectance: Reflectance = Field(
        default=[0.5, 0.5, 0.5], description="Hemispherical diffuse reflectance, each channel in [0, 1)."
    )
    emission: Emission = Field(
        default=[0.0, 0.0, 0.0], description="Emitted radiant exitance in W/m2 per channel."
    )
    specular: Reflectance = Field(
        default=[0.0, 0.0, 0.0],
        description="Hemispherical specular reflectance, each channel in [0, 1); with the reflectance of the "
        "channel, below 1.",
    )
    exponent: Exponent | None = Field(
        default=None,
        description="Phong exponent n of specular reflection, a lobe about the mirrored direction, or null "
        "for a perfect mirror. A lobe reflects less the more light grazes the surface.",
    )
    emission_exponent: Exponent = Field(
        default=0.0,
        description="Exponent d of directional emission: radiance goes with cos^d of the angle to the "
        "normal, at the same radiant exitance. 0 is diffuse emission.",
    )
    two_sided: bool = Field(
        default=False,
        strict=True,
        description="Whether the back reflects and emits too. Otherwise it is black, and blocks light.",
    )


class TransformDocument(Closed):
    """Maps the mesh to the world: scale, then rotate, then translate; or any invertible affine matrix."""

    translation: Point = Field(default=[0.0, 0.0, 0.0], description="Metres.")
    rotation: Quaternion = Field(
        default=[0.0, 0.0, 0.0, 1.0], description="Quaternion x, y, z, w. It is normalised."
    )
    scale: Scale = Field(default=[1.0, 1.0, 1.0], description="One factor, or one for each axis; none is 0.")
    matrix: Matrix | None = Field(
        default=None,
        description="16 numbers, row-major, last row 0 0 0 1. Stands alone, without the other fields.",
    )

    @model_validator(mode="after")
    def _parts_or_matrix(self) -> TransformDocument:
        if self.matrix is not None and self.model_fields_set != {"matrix"}:
            raise PydanticCustomError(
                "matrix_and_parts", "give either a matrix or translation, rotation and scale, not both"
            )
        return self


class ObjectDocument(Closed):
    """A mesh of one material, placed in the world."""

    id: Identifier = Field(description="The client's name of the object, unique in the scene.")
    mesh: MeshDocument
    material: MaterialDocument = MaterialDocument()
    transform: TransformDocument = TransformDocument()


class CameraDocument(Closed):
    """A pinhole camera. Without an eye, it is placed where most of the scene is in view."""

    eye: Point | None = Field(default=None, description="Where the camera stands, metres.")
    target: Point | None = Field(
        default=None, description="The point in the middle of the frame; by default the middle of the scene."
    )
    up: Direction | None = Field(
        default=None,
        description="The direction that is up in the frame; by default z, or y when looking along z.",
    )
    vertical_fov: FieldOfView = Field(default=55.0, description="Full vertical angle of view, degrees.")
    width: Extent = Field(default=640, description="Pixels.")
    height: Extent = Field(default=480, description="Pixels.")


class SceneDocument(Closed):
    """A scene: objects, and the cameras that look at them."""

    name: str = Field(default="", strict=True, max_length=200, description="Shown to people.")
    luminous_efficacy: float = Field(
        default=179.0,
        strict=True,
        allow_inf_nan=False,
        gt=0.0,
        le=1e6,
        description="lm/W: photometric values are this times the luminance of the radiometric triple.",
    )
    objects: list[ObjectDocument] = Field(default=[])
    cameras: dict[Identifier, CameraDocument] = Field(
        default={}, description="By name. Without any there is one, `main`, that overlooks the scene."
    )
    notes: list[Annotated[str, Field(strict=True, max_length=1000)]] = Field(
        default=[],
        max_length=100,
        description="What a user should know of where the scene has come from, told among the warnings of "
        "its sessions. Files of other formats are read with a note on all that could not be kept.",
    )
