"""Points, lines and triangles with colours: what an overlay looks like ([H B.4]'s colours)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from solver.types import Corners, FloatArray, IntArray

WHITE: Final = (1.0, 1.0, 1.0)
BLACK: Final = (0.0, 0.0, 0.0)
PINK: Final = (1.0, 0.35, 0.6)
GREEN: Final = (0.05, 0.7, 0.1)
VIOLET: Final = (0.45, 0.1, 0.9)
YELLOW: Final = (1.0, 0.85, 0.0)
BLUE: Final = (0.1, 0.3, 1.0)
RED: Final = (0.9, 0.05, 0.05)
"""Linear RGB"""

Colour = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Primitives:
    """n points, lines or triangles: figures of k = 1, 2 or 3 places."""

    position: FloatArray
    """(n, k, 3) metres"""
    colour: FloatArray
    """(n, 3) linear RGB, each 0 to 1"""

    @classmethod
    def of(cls, position: FloatArray, colour: FloatArray | Colour) -> Primitives:
        """Figures (n, k, 3) in colours (n, 3), or all in one."""
        return cls(position, np.broadcast_to(np.asarray(colour, dtype=np.float64), (len(position), 3)))

    @classmethod
    def none(cls, corners: int) -> Primitives:
        """No figures of so many places."""
        return cls(np.empty((0, corners, 3)), np.empty((0, 3)))

    def __len__(self) -> int:
        return len(self.position)

    def __add__(self, other: Primitives) -> Primitives:
        return Primitives(
            np.concatenate([self.position, other.position]), np.concatenate([self.colour, other.colour])
        )


def _no_points() -> Primitives:
    return Primitives.none(1)


def _no_lines() -> Primitives:
    return Primitives.none(2)


def _no_triangles() -> Primitives:
    return Primitives.none(3)


@dataclass(frozen=True, eq=False)
class Shapes:
    """What is drawn."""

    points: Primitives = field(default_factory=_no_points)
    lines: Primitives = field(default_factory=_no_lines)
    triangles: Primitives = field(default_factory=_no_triangles)


def outlines(corners: Corners, count: IntArray, colour: FloatArray | Colour) -> Primitives:
    """The sides of polygons (n, 4, 3) of 3 or 4 corners, as lines in colours (n, 3), or all in one."""
    colours = np.broadcast_to(np.asarray(colour, dtype=np.float64), (len(corners), 3))
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
    # The side of a triangle from its last corner to the same has no length.
    there = np.arange(4) < np.where(count == 3, 2, 4)[:, None]
    there[:, 3] = True
    return Primitives(sides[there], np.repeat(colours, there.sum(axis=1), axis=0))


def faces(corners: Corners, count: IntArray, colour: FloatArray | Colour) -> Primitives:
    """Convex polygons (n, 4, 3) of 3 or 4 corners as triangles in colours (n, 3), or all in one."""
    colours = np.broadcast_to(np.asarray(colour, dtype=np.float64), (len(corners), 3))
    pieces = corners[:, [[0, 1, 2], [0, 2, 3]]]
    there = np.arange(2) < (count - 2)[:, None]
    return Primitives(pieces[there], np.repeat(colours, there.sum(axis=1), axis=0))
