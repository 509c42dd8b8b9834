"""A twin of visible parts: blockers are projected onto the source's plane and subtracted; the tests' oracle.

A blocker is first clipped to what lies between point and source, the pyramid with the source as its base, so
that its projection stays within the source. shapely subtracts, and Lambert's formula goes round the rings of
what is left, holes included: no convex pieces anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from solver.types import FloatArray, Points, Vector

ON_PLANE: Final = 1e-10
"""What is as close to a plane as this times the size of the view is on it: a point on that of a blocker, a
blocker on that of the source."""

_GRID: Final = 1e-13
"""Coordinates are rounded to multiples of this times the size: shapely is then robust without exception."""


@dataclass(frozen=True, eq=False)
class View:
    """A point with a unit normal (3,), the source that it looks at, and polygons that may be in between.

    Polygons are (3 or 4, 3), convex; the point is before the front of the source.
    """

    x: Vector
    normal: Vector
    source: Points
    blockers: tuple[Points, ...]

    @property
    def size(self) -> float:
        """Metres: the diagonal of the bounding box of all of it."""
        return float(
            np.linalg.norm(np.ptp(np.concatenate([self.x[None], self.source, *self.blockers]), axis=0))
        )


@dataclass(frozen=True, eq=False)
class Region:
    """A part of a source's plane."""

    shape: shapely.Geometry
    """in the plane's coordinates"""
    origin: Vector
    axes: FloatArray
    """(2, 3) right-handed seen from the source's front"""

    def flat(self, polygon: Points) -> FloatArray:
        """Points of the plane (n, 3) in its coordinates, (n, 2)."""
        return np.asarray((polygon - self.origin) @ self.axes.T)

    def factor(self, x: Vector, normal: Vector) -> float:
        """Its form factor [H eq. 6.1]."""
        rings = [
            np.asarray(ring.coords)
            for part in shapely.get_parts(self.shape)
            if part.geom_type == "Polygon" and part.area > 0.0
            for ring in (lambda p: (p.exterior, *p.interiors))(shapely.orient_polygons(part))
        ]
        return sum(_contour(self.origin + ring @ self.axes, x, normal) for ring in rings)


def normal_of(polygon: Points) -> Vector:
    """Unit normal on the side from which a convex polygon runs counter-clockwise."""
    normal = np.cross(polygon[2] - polygon[0], polygon[-1] - polygon[1])
    return np.asarray(normal / np.linalg.norm(normal))


def visible_region(view: View) -> Region:
    """The part of the source above the horizon that no blocker hides."""
    whole = source_region(view)
    hidden = [shadow for blocker in view.blockers if (shadow := _shadow(view, blocker, whole)) is not None]
    grid = _GRID * view.size
    left = shapely.difference(whole.shape, shapely.union_all(hidden, grid_size=grid), grid_size=grid)
    return Region(left, whole.origin, whole.axes)


def source_region(view: View) -> Region:
    """The part of the source above the horizon."""
    first = view.source[1] - view.source[0]
    first = first / np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal_of(view.source), first)])
    frame = Region(shapely.Polygon(), view.source[0], axes)
    above = _clip(view.source, view.normal, float(view.normal @ view.x))
    shape = shapely.Polygon(frame.flat(above)) if len(above) > 2 else shapely.Polygon()
    return Region(shape, frame.origin, axes)


def _shadow(view: View, blocker: Points, plane: Region) -> shapely.Geometry | None:
    """What a blocker hides, in the coordinates of the source's plane."""
    source_normal = normal_of(view.source)
    tolerance = ON_PLANE * view.size
    if abs(normal_of(blocker) @ (blocker[0] - view.x)) <= tolerance:
        return None
    if ((blocker - view.source[0]) @ source_normal).max() <= tolerance:
        return None
    part = _clip(blocker, source_normal, float(source_normal @ view.source[0]))
    for start, end in zip(view.source, np.roll(view.source, -1, axis=0), strict=True):
        side = np.cross(end - view.x, start - view.x)
        part = _clip(part, side, float(side @ view.x))
    if len(part) < 3:
        return None
    height = float(source_normal @ (view.x - view.source[0]))
    way = part - view.x
    end = view.x + way * (-height / (way @ source_normal))[:, None]
    shadow = shapely.MultiPoint(plane.flat(end)).convex_hull
    return shadow if shadow.geom_type == "Polygon" else None


def _clip(polygon: Points, normal: Vector, offset: float) -> Points:
    """The part of a convex polygon on a plane or above it."""
    kept: list[Vector] = []
    heights = polygon @ normal - offset
    for k in range(len(polygon)):
        if heights[k - 1] * heights[k] < 0.0:
            share = heights[k - 1] / (heights[k - 1] - heights[k])
            kept.append(polygon[k - 1] + share * (polygon[k] - polygon[k - 1]))
        if heights[k] >= 0.0:
            kept.append(polygon[k])
    return np.array(kept).reshape(-1, 3)


def _contour(ring: Points, x: Vector, normal: Vector) -> float:
    """Lambert's sum along a closed ring (n, 3); counter-clockwise ones seen from x count as positive."""
    a, b = ring[:-1] - x, ring[1:] - x
    across = np.cross(b - a, a)
    length = np.linalg.norm(across, axis=1)
    angle = np.arctan2(length, np.einsum("na,na->n", a, b))
    used = length > 0.0
    return float((angle[used] * (across[used] @ normal) / length[used]).sum() / (2.0 * np.pi))
