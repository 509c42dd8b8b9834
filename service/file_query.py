"""What a query says of a file that is posted as it is, and the media types of such files."""

from __future__ import annotations

from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field

from solver.document.limits import SceneLimits
from solver.formats.reading import SceneFormat
from solver.formats.source import ReadOptions, UpAxis

MEDIA_TYPES: Final[dict[str, SceneFormat | None]] = {
    "model/gltf-binary": SceneFormat.GLB,
    "model/gltf+json": SceneFormat.GLTF,
    "model/obj": SceneFormat.OBJ,
    "model/stl": SceneFormat.STL,
    "model/x-mgf": SceneFormat.MGF,
    "text/x-mgf": SceneFormat.MGF,
    "model/x-ies": SceneFormat.IES,
    "text/x-ies": SceneFormat.IES,
    "application/zip": SceneFormat.ZIP,
    "application/octet-stream": None,
}
"""None where the query must say the format. No page of another origin may send these unasked."""

_Scale = Annotated[float, Field(ge=1e-9, le=1e9, allow_inf_nan=False)]


class FileQuery(BaseModel):
    """How a file is to be read, where it does not say so itself."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: SceneFormat | None = Field(
        default=None,
        description="Of a file: its format, where the content type does not tell. `zip` holds one file of "
        "the others and what it names.",
    )
    name: str | None = Field(default=None, max_length=200, description="Of a file: the scene's name.")
    scale: _Scale = Field(default=1.0, description="Of a file: metres of one of its units.")
    up: UpAxis | None = Field(
        default=None,
        description="Of a file: which axis is up for the camera of a scene that has none. By default y for "
        "glTF and OBJ, z for others.",
    )
    two_sided: bool | None = Field(
        default=None,
        description="Of OBJ and STL, which do not tell: whether surfaces have two sides. By default those of "
        "OBJ have, but for what emits, and those of STL have not.",
    )
    luminous_efficacy: Annotated[float, Field(gt=0.0, le=1e6, allow_inf_nan=False)] | None = Field(
        default=None,
        description="Of a file in photometric units: lm/W by which these become watts. By default 179.",
    )
    merge: bool = Field(
        default=True,
        description="Of a file: whether triangles side by side in one plane become one polygon.",
    )
    settings: str | None = Field(
        default=None,
        max_length=10_000,
        description="With a file: the session's settings, as JSON.",
        examples=['{"error_tolerance": 0.05}'],
    )

    def options(self, limits: SceneLimits) -> ReadOptions:
        """What a reader is told."""
        return ReadOptions(
            scale=self.scale,
            up=self.up,
            two_sided=self.two_sided,
            luminous_efficacy=self.luminous_efficacy,
            merge=self.merge,
            limits=limits,
        )


def described() -> dict[str, Any]:
    """What the API's description says of a call that takes files."""
    schema = FileQuery.model_json_schema()
    definitions = schema.get("$defs", {})
    parameters = []
    for name, told in schema["properties"].items():
        # Enumerations stand where they are used: the description names no components of them.
        inlined = _inlined(told, definitions)
        description = inlined.pop("description")
        parameters.append({"name": name, "in": "query", "description": description, "schema": inlined})
    binary = {"schema": {"type": "string", "format": "binary"}}
    return {"parameters": parameters, "requestBody": {"content": dict.fromkeys(MEDIA_TYPES, binary)}}


def _inlined(told: Any, definitions: dict[str, Any]) -> Any:
    if isinstance(told, list):
        return [_inlined(part, definitions) for part in told]
    if not isinstance(told, dict):
        return told
    if "$ref" in told:
        return _inlined(definitions[told["$ref"].rpartition("/")[2]], definitions)
    return {key: _inlined(part, definitions) for key, part in told.items()}
