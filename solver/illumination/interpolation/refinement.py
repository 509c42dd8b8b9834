"""Which cells to split: representation-based refinement, over what is looked at ([H 4.4.2, 8.3]).

[H] builds interpolants on every level of the quadtree and doubts that it can be afforded. Here they are only
built for triangles that a camera sees, their error is told by one more point irradiance each, and samples
outlive the split of a cell, so that a level costs what is new on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.illumination.interpolation.interpolants import Interpolants
from solver.types import BoolArray, FloatArray

LOCAL: Final = 3.0
"""A cell is split, too, if it errs by this times the tolerance relative to its own irradiance: dark places
count little in a picture's RMS error, and are looked at all the same."""

_LEAST_PIXELS: Final = 6.0
"""A cell that so few pixels see is not split."""

_AIM: Final = 0.7
"""Part of the tolerance that splitting aims at."""

_URGENT: Final = 0.5
"""Part of the tolerance that cells must err by to be split before all others are known."""

_RESOLVED: Final = 0.9
"""Share of a cell's squared error that splitting takes away: quadratics err by the third power of size."""


@dataclass(frozen=True)
class ViewError:
    """What is known of the interpolation error over what is looked at."""

    relative: float
    """RMS luminance error over RMS luminance irradiance"""
    share_known: float
    """part of the pixels whose triangle has been checked"""


def view_error(interpolants: Interpolants, pixels: FloatArray) -> ViewError:
    """The interpolation error as `pixels` (t,) see it."""
    seen = float(pixels.sum())
    if seen <= 0.0:
        return ViewError(0.0, 1.0)
    light = float((pixels * interpolants.mean_luminance() ** 2).sum())
    error = float((pixels * interpolants.errors() ** 2).sum())
    known = float(pixels[interpolants.is_checked].sum()) / seen
    return ViewError(float(np.sqrt(error / light)) if light > 0.0 else 0.0, known)


def cells_to_split(interpolants: Interpolants, pixels: FloatArray, tolerance: float) -> BoolArray:
    """(n,) cells whose interpolants err too much for an RMS error of `tolerance` over the `pixels` (t,)."""
    chosen, _ = _choose(interpolants, pixels, tolerance)
    return chosen


def has_urgent_cells(interpolants: Interpolants, pixels: FloatArray, tolerance: float) -> bool:
    """Whether those to split are most of the error, before all that the `pixels` (t,) see is checked."""
    _, share = _choose(interpolants, pixels, tolerance)
    return share > _URGENT**2


def _choose(interpolants: Interpolants, pixels: FloatArray, tolerance: float) -> tuple[BoolArray, float]:
    """(n,) cells to split by what is checked, and their squared RMS error relative to squared `tolerance`."""
    n = len(interpolants.cells.patch)
    cell = interpolants.triangulation.cell
    weight = np.where(interpolants.is_checked, pixels, 0.0)
    brightness = interpolants.mean_luminance() ** 2
    light = np.bincount(cell, weight * brightness, n)
    error = np.bincount(cell, weight * interpolants.errors() ** 2, n)
    seen = np.bincount(cell, weight, n)
    total = float((pixels * brightness).sum())
    if total <= 0.0:
        return np.zeros(n, dtype=np.bool_), 0.0
    large = seen > _LEAST_PIXELS
    chosen = large & (error > (LOCAL * tolerance) ** 2 * light)
    left = float(error.sum()) - _RESOLVED * float(error[chosen].sum())
    goal = (_AIM * tolerance) ** 2 * total
    if left > tolerance**2 * total:
        others = np.flatnonzero(large & ~chosen)
        order = others[np.argsort(-error[others], kind="stable")]
        gained = _RESOLVED * np.cumsum(error[order])
        count = int(np.searchsorted(gained, left - goal)) + 1
        chosen[order[:count]] = True
    chosen &= error > 0.0
    return chosen, float(error[chosen].sum()) / (tolerance**2 * total)
