"""Edits, as the service takes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

Edit: TypeAlias = Mapping[str, Any]


def add(object: Mapping[str, Any]) -> Edit:
    """Put an object into the scene: `id`, `mesh`, and more if wanted."""
    return {"op": "add", "object": object}


def remove(id: str) -> Edit:
    """Take an object out."""
    return {"op": "remove", "id": id}


def move(
    id: str,
    translation: Sequence[float] | None = None,
    rotation: Sequence[float] | None = None,
    scale: float | Sequence[float] | None = None,
    matrix: Sequence[float] | None = None,
) -> Edit:
    """Place an object anew: metres, a quaternion x, y, z, w and factors, or 16 numbers, row-major."""
    given = {"translation": translation, "rotation": rotation, "scale": scale, "matrix": matrix}
    return {"op": "move", "id": id, "transform": {k: v for k, v in given.items() if v is not None}}


def set_material(id: str, **material: Any) -> Edit:
    """Give an object another material: `reflectance`, `emission` in W/m2, `two_sided`, and more."""
    return {"op": "set_material", "id": id, "material": material}


def set_mesh(id: str, vertices: Sequence[Sequence[float]], faces: Sequence[Sequence[int]]) -> Edit:
    """Give an object another shape."""
    return {"op": "set_mesh", "id": id, "mesh": {"vertices": vertices, "faces": faces}}
