"""Primitives of glTF as vertices and faces: triangles, strips, fans, and polygons that are marked."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.document.fields import Location
from solver.errors import SceneError
from solver.formats.gltf.container import Container
from solver.formats.gltf.models import Primitive
from solver.types import Int64Array, Points

NGONS: Final = "FB_ngon_encoding"
"""Extension by which triangles in a row about one first vertex are a polygon."""

_TRIANGLES: Final = 4
_STRIP: Final = 5


def positions(container: Container, primitive: Primitive, where: Location) -> Points | None:
    """(n, 3) vertices; None for points, lines and what has no places. Raises SceneError."""
    if primitive.mode < _TRIANGLES or "POSITION" not in primitive.attributes:
        return None
    return container.floats(primitive.attributes["POSITION"], 3, (*where, "attributes", "POSITION"))


def triangles_of(container: Container, primitive: Primitive, count: int, where: Location) -> Int64Array:
    """(t, 3) corners among `count` vertices. Raises SceneError."""
    if primitive.indices is None:
        order = np.arange(count)
    else:
        order = container.indices(primitive.indices, (*where, "indices"))
        if len(order) and order.max() >= count:
            raise SceneError(f"there is no vertex {order.max()}: there are {count}", (*where, "indices"))
    if primitive.mode == _TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    if len(order) < 3:
        return np.empty((0, 3), dtype=np.int64)
    if primitive.mode == _STRIP:
        strip = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
        strip[1::2] = strip[1::2][:, [1, 0, 2]]
        return strip
    return np.stack([np.full(len(order) - 2, order[0]), order[1:-1], order[2:]], axis=1)


def polygons_of(primitive: Primitive, triangles: Int64Array) -> tuple[list[list[int]], Int64Array]:
    """Faces, and (f + 1,) how many triangles there are before each."""
    if NGONS not in primitive.extensions or len(triangles) == 0:
        return triangles.tolist(), np.arange(len(triangles) + 1, dtype=np.int64)
    goes_on = (triangles[1:, 0] == triangles[:-1, 0]) & (triangles[1:, 1] == triangles[:-1, 2])
    start = np.concatenate([[0], np.flatnonzero(~goes_on) + 1, [len(triangles)]])
    rows = triangles.tolist()
    faces = [
        [*rows[a][:2], *(row[2] for row in rows[a:b])]
        for a, b in zip(start[:-1].tolist(), start[1:].tolist(), strict=True)
    ]
    return faces, start
