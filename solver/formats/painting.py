"""Surfaces whose faces differ in colour, as few objects of one material each.

An object has one material. Where a texture is much the same all over, its mean will do; where it is a
palette, whose faces point to patches of colour, each colour becomes an object of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from solver.geometry.faces import newell_normal
from solver.types import FloatArray, Points

_ALIKE: Final = 0.04
"""Faces whose values differ by no more than this from the mean are of one colour."""

_MOST_GROUPS: Final = 12
_FINEST: Final = 16
"""Steps of each value from the least to the greatest, to begin with."""


def paint_groups(
    vertices: Points, faces: Sequence[Sequence[int]], values: FloatArray
) -> Iterator[tuple[list[int] | None, FloatArray]]:
    """Groups of faces, None for all, and the means (k,) of the `values` (f, k) or (1, k) of their faces.

    Means are weighted by the areas of the faces.
    """
    if len(values) == 1:
        yield None, values[0]
        return
    area = np.array([_area(vertices, face) for face in faces])
    if area.sum() <= 0.0:
        area = np.ones(len(faces))
    mean = np.average(values, axis=0, weights=area)
    if np.abs(values - mean).max() <= _ALIKE:
        yield None, mean
        return
    label = _labels(values)
    for group in range(int(label.max()) + 1):
        members = np.flatnonzero(label == group)
        weights = area[members] if area[members].sum() > 0.0 else None
        yield members.tolist(), np.average(values[members], axis=0, weights=weights)


def _labels(values: FloatArray) -> FloatArray:
    """(f,) number of the group of each face."""
    low, span = values.min(axis=0), np.ptp(values, axis=0)
    unit = (values - low) / np.where(span > 0.0, span, 1.0)
    for steps in range(_FINEST, 0, -1):
        cell = np.minimum((unit * steps).astype(np.int64), steps - 1)
        _, label = np.unique(cell, axis=0, return_inverse=True)
        if label.max() < _MOST_GROUPS:
            break
    return np.asarray(label.ravel())


def _area(vertices: Points, face: Sequence[int]) -> float:
    return 0.5 * float(np.linalg.norm(newell_normal(vertices[list(face)][None])[0]))
