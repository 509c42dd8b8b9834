"""The scenes that ship with the package, by name, and scene files."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from pydantic import ValidationError

from solver.document.conversion import scene_of
from solver.document.fields import Location
from solver.document.models import SceneDocument
from solver.errors import SceneError
from solver.geometry.scene import Scene


def sample_names() -> tuple[str, ...]:
    """Names of the sample scenes, in alphabetical order."""
    files = resources.files("solver").joinpath("samples").iterdir()
    return tuple(sorted(file.name.removesuffix(".json") for file in files if file.name.endswith(".json")))


def load_sample(name: str) -> Scene:
    """The sample scene of that name. Raises SceneError where there is none."""
    if name not in sample_names():
        raise SceneError(f"no sample scene {name!r}; there are {', '.join(sample_names())}", ("sample",))
    return parse_scene(resources.files("solver").joinpath("samples", f"{name}.json").read_bytes())


def load_scene(path: Path) -> Scene:
    """The scene of a JSON file. Raises SceneError, or OSError where the file cannot be read."""
    return parse_scene(path.read_bytes())


def parse_scene(text: bytes) -> Scene:
    """The scene of a JSON document. Raises SceneError for the first field that is not acceptable."""
    try:
        document = SceneDocument.model_validate_json(text)
    except ValidationError as refused:
        first = refused.errors(include_url=False, include_context=False, include_input=False)[0]
        location: Location = first["loc"]
        raise SceneError(first["msg"], location) from None
    return scene_of(document)
