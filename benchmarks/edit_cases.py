"""The edits that are measured: an object of a sample scene comes, or moves to where it is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from solver.geometry.scene import Scene
from solver.geometry.transform import Transform
from solver.types import ObjectId


@dataclass(frozen=True)
class Edit:
    """An object of a sample scene that comes, or moves to where it is."""

    scene: str
    object: ObjectId
    shift: tuple[float, float, float] | None = None
    """Metres from where it was before; None: it was not there"""
    is_small: bool = False
    """Whether there are targets for how soon all is done"""

    @property
    def label(self) -> str:
        """What is done."""
        if self.shift is None:
            return f"add {self.object}"
        return f"move {self.object} by {math.hypot(*self.shift):g} m"

    def before(self, after: Scene) -> Scene:
        """The scene that the edit leads to `after` from."""
        if self.shift is None:
            return after.without_object(self.object)
        return moved(after, self.object, (-self.shift[0], -self.shift[1], -self.shift[2]))


EDITS: Final = (
    Edit("cube_room", "cube"),
    Edit("cube_room", "cube", (-0.5, 0.0, 0.0)),
    Edit("robot_cell", "robot"),
    Edit("robot_cell", "robot", (-0.5, 0.0, 0.0)),
    Edit("robot_cell", "part3", (-0.25, 0.0, 0.0), is_small=True),
)


def moved(scene: Scene, name: ObjectId, shift: tuple[float, float, float]) -> Scene:
    """The scene with one object moved by (3,) metres."""
    there = scene.object(name)
    matrix = there.transform.matrix.copy()
    matrix[:3, 3] += shift
    return scene.with_replaced(replace(there, transform=Transform(matrix)))
