"""STL: triangles of solids, binary or as text.

Corners are counter-clockwise from outside; normals and colours of facets are of no account.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.errors import LimitExceededError, SceneError
from solver.formats.building import Imported, SceneBuilder
from solver.formats.shading import Shade
from solver.formats.source import ReadOptions, SourceFile, UpAxis
from solver.formats.text import numbered_lines, numbers_of
from solver.types import FloatArray

_HEAD: Final = 84
"""Bytes before the first facet: a header of 80, and how many there are."""

_FACET: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

_GREY: Final = 0.5


def read_stl(source: SourceFile, options: ReadOptions) -> Imported:
    """The solids of a file, each one grey object. Raises SceneError, LimitExceededError."""
    builder = SceneBuilder(options, UpAxis.Z)
    content = source.content
    if _is_binary(content):
        solids = [(source.name, _binary(content, options))]
    elif content.lstrip().startswith(b"solid"):
        solids = _text(content)
    else:
        raise SceneError("neither is it as long as its count of facets says, nor does it begin with `solid`")
    shade = Shade.matt(np.full(3, _GREY), two_sided=bool(options.two_sided))
    for number, (name, triangles) in enumerate(solids):
        corners = triangles.reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3).tolist()
        builder.add(name or "solid", corners, faces, shade, ("solids", number))
    builder.warn(f"STL has no materials: all is grey, of reflectance {_GREY:g}")
    return builder.finish(source.name)


def _is_binary(content: bytes) -> bool:
    count = int.from_bytes(content[80:84], "little")
    return len(content) >= _HEAD and len(content) == _HEAD + count * _FACET.itemsize


def _binary(content: bytes, options: ReadOptions) -> FloatArray:
    """(t, 3, 3) corners."""
    facets = np.frombuffer(content, dtype=_FACET, offset=_HEAD)
    most = options.limits.max_vertices * 16
    if 3 * len(facets) > most:
        raise LimitExceededError("vertices", 3 * len(facets), most)
    return facets["corners"].astype(np.float64)


def _text(content: bytes) -> list[tuple[str, FloatArray]]:
    """The solids of a text, by name."""
    solids: list[tuple[str, FloatArray]] = []
    name, facet = "", 0
    corners: list[list[float]] = []
    is_open = False
    for line, words in numbered_lines(content):
        match words[0].lower():
            case "solid":
                name, corners, is_open = " ".join(words[1:]), [], True
            case "vertex":
                corners.append(numbers_of(words[1:], line, 3))
            case "facet":
                facet = len(corners)
            case "endfacet":
                if len(corners) - facet != 3:
                    raise SceneError(f"a facet of {len(corners) - facet} vertices", ("line", line))
            case "endsolid":
                if len(corners) % 3:
                    raise SceneError("vertices outside of facets", ("line", line))
                solids.append((name, np.array(corners).reshape(-1, 3, 3)))
                is_open = False
            case "outer" | "endloop":
                pass
            case other:
                raise SceneError(f"{other[:40]!r} is no word of STL", ("line", line))
    if is_open:
        raise SceneError("the file ends before `endsolid`")
    return solids
