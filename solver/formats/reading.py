"""Files of all formats that are read, told apart by what the client says or by their names."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import PurePath
from typing import Final

from pydantic import ValidationError

from solver.document.models import SceneDocument
from solver.errors import SceneError
from solver.formats.archives import unpack
from solver.formats.building import Imported
from solver.formats.gltf.reader import read_gltf
from solver.formats.ies import read_ies
from solver.formats.mgf.reader import read_mgf
from solver.formats.obj import read_obj
from solver.formats.source import ReadOptions, SourceFile
from solver.formats.stl import read_stl


class SceneFormat(StrEnum):
    """The formats that scenes are read from."""

    GLB = "glb"
    GLTF = "gltf"
    OBJ = "obj"
    STL = "stl"
    MGF = "mgf"
    IES = "ies"
    ZIP = "zip"
    """One file of the others, and what it names"""


_READERS: Final[dict[SceneFormat, Callable[[SourceFile, ReadOptions], Imported]]] = {
    SceneFormat.GLB: read_gltf,
    SceneFormat.GLTF: read_gltf,
    SceneFormat.OBJ: read_obj,
    SceneFormat.STL: read_stl,
    SceneFormat.MGF: read_mgf,
    SceneFormat.IES: read_ies,
}

MOST_UNPACKED: Final = 2**27
"""Bytes that an archive may hold when unpacked, unless a caller says otherwise."""


def format_of(name: str) -> SceneFormat | None:
    """The format that the name of a file says."""
    suffix = PurePath(name).suffix.lower().removeprefix(".")
    return SceneFormat(suffix) if suffix in set(SceneFormat) else None


def read_scene(
    source: SourceFile, chosen: SceneFormat, options: ReadOptions, most_unpacked: int = MOST_UNPACKED
) -> Imported:
    """The scene of a file. Raises SceneError whose location is where in the file, LimitExceededError."""
    if chosen is SceneFormat.ZIP:
        source = unpack(source.content, [f".{known}" for known in _READERS], most_unpacked)
        found = format_of(source.name)
        if found is None:
            raise SceneError(f"{source.name[:80]!r} is of no format that is read", ("archive",))
        chosen = found
    titled = SourceFile(PurePath(source.name).stem, source.content, source.beside)
    try:
        return _READERS[chosen](titled, options)
    except ValidationError as refused:
        # Readers check what they read; what they make of it is checked once more by the document.
        first = refused.errors(include_url=False, include_context=False, include_input=False)[0]
        raise SceneError(f"{first['msg']}, in {SceneDocument.__name__}", first["loc"]) from None
