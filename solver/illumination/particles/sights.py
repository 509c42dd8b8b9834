"""What virtual lights see: for each a map of its hemisphere that holds the polygon seen in every texel.

The shadow maps of instant radiosity ([K 3], after Heidmann and Segal et al.) hold depths, and a bias must
keep surfaces from shadowing themselves: too little of it shows, too much leaks light through thin walls.
Maps of polygons need none. A receiver asks which polygons the four texels around it see: its own, or one
that its straight line to the light truly crosses. So a shadow's edge lies where it should, to float32, at
any resolution; what is missed are blockers, and gaps, that fall between texels.

Maps are traced by rays, which cost as much in a large scene as in a small one, and none for what is hidden.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from solver.illumination.particles.hemisphere import texel_directions
from solver.illumination.particles.receivers import Polygons
from solver.kernels import kernel
from solver.parallel import run_chunks
from solver.tolerances import TOUCH
from solver.types import Float32Array, Int64Array, IntArray
from solver.visibility.rays import CHUNK, RayScene

RESOLUTION: Final = 128
"""Texels along a side of a map."""

MOST_RESOLUTION: Final = 255
"""So that the polygons of a map can be numbered by two bytes."""

Texels: TypeAlias = NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class Sights:
    """The maps of m lights, and the s polygons that are in them."""

    texels: Texels
    """(m, r, r) polygon seen, in numbers of the light's own; 0 for nothing"""
    start: IntArray
    """(m + 1,) where each light's polygons begin; its first stands for nothing"""
    polygon: IntArray
    """(s,) number in the scene; 0 for nothing"""
    cone: Float32Array
    """(s, 16) normals of the four planes through the light and an edge, inwards, of any length; and the
    polygon's plane, with the light on its negative side: what is behind it and within all four is hidden"""

    @cached_property
    def alike(self) -> Texels:
        """(m, r, r) polygon that a texel sees, and the three after it to the right and below too; else 0."""
        alike = np.empty_like(self.texels)
        _compare(self.texels, alike)
        return alike

    def __len__(self) -> int:
        return len(self.texels)

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return 2 * self.texels.nbytes + self.start.nbytes + self.polygon.nbytes + self.cone.nbytes

    def part(self, first: int, last: int) -> Sights:
        """The maps of some lights in a row."""
        begin, end = self.start[first], self.start[last]
        return Sights(
            self.texels[first:last],
            (self.start[first : last + 1] - begin).astype(np.int32),
            self.polygon[begin:end],
            self.cone[begin:end],
        )


@dataclass(frozen=True, eq=False)
class Known:
    """What some lights saw of a scene before it was edited, in maps of the same resolution."""

    sights: Sights
    row: IntArray
    """(m,) map of each light in `sights`, -1 where there is none"""
    renumbered: IntArray
    """(q before + 1,) number that each polygon has now, -1 where it is no longer where it was"""
    boxes: Float32Array
    """(k, 2, 3) local: around what was not there before"""


def look_around(
    rays: RayScene,
    polygons: Polygons,
    frames: Float32Array,
    resolution: int = RESOLUTION,
    known: Known | None = None,
) -> Sights:
    """What lights see, in maps of `resolution` texels square.

    `frames` (12, m) holds local positions, unit normals and the two tangents. Of lights that are `known` only
    those texels are traced that saw what is gone, or look where something has come. Raises ValueError for a
    resolution that is not in 2 to `MOST_RESOLUTION`.
    """
    if not 2 <= resolution <= MOST_RESOLUTION:
        raise ValueError(f"maps have 2 to {MOST_RESOLUTION} texels along a side, not {resolution}")
    table = texel_directions(resolution)
    n, m = len(table), frames.shape[1]
    texels = np.empty((m, n), dtype=np.uint16)
    found: list[IntArray] = [np.empty(0, dtype=np.int32)] * m
    of_triangle = np.concatenate([polygons.of_triangle, np.zeros(1, dtype=np.int32)])

    def trace(start: int, stop: int) -> None:
        origins = np.empty((n, 3), dtype=np.float32)
        directions = np.empty((n, 3), dtype=np.float32)
        seen = np.empty(n, dtype=np.int32)
        number = np.zeros(len(polygons) + 1, dtype=np.int32)
        palette = np.empty(n + 1, dtype=np.int32)
        for light in range(start, stop):
            _aim(frames, light, table, np.float32(rays.offset), origins, directions)
            row = -1 if known is None else int(known.row[light])
            if known is None or row < 0:
                for first in range(0, n, CHUNK):
                    part = slice(first, first + CHUNK)
                    seen[part] = of_triangle[rays.first_local(origins[part], directions[part])]
            else:
                before = known.sights
                changed = _recall(
                    before.texels[row].reshape(-1), before.polygon[before.start[row] : before.start[row + 1]],
                    known.renumbered, known.boxes, origins, directions, seen,
                )  # fmt: skip
                hit = rays.first_local(origins[changed], directions[changed])
                seen[changed] = of_triangle[hit]
            found[light] = palette[: number_polygons(seen, number, palette, texels[light])].copy()

    run_chunks(trace, m, 8, 1)
    start = np.zeros(m + 1, dtype=np.int32)
    np.cumsum([len(part) for part in found], out=start[1:])
    polygon = np.concatenate([*found, np.empty(0, dtype=np.int32)])
    cone = np.empty((len(polygon), 16), dtype=np.float32)
    span_cones(frames, start, polygon, polygons.corners, polygons.plane, cone)
    return Sights(texels.reshape(m, resolution, resolution), start, polygon, cone)


def join_sights(parts: list[Sights]) -> Sights:
    """The maps of all lights in `parts`, one after the other; all have one resolution."""
    offset = np.cumsum([0, *(len(part.polygon) for part in parts)])
    start: list[Any] = [part.start[:-1] + offset[i] for i, part in enumerate(parts)]
    return Sights(
        np.concatenate([part.texels for part in parts]),
        np.concatenate([*start, offset[-1:]]).astype(np.int32),
        np.concatenate([part.polygon for part in parts]),
        np.concatenate([part.cone for part in parts]),
    )


@kernel
def _aim(
    frames: Float32Array,
    light: int,
    table: Float32Array,
    offset: np.float32,
    origins: Float32Array,
    directions: Float32Array,
) -> None:
    """Rays (n, 3) through the texels of `table` (n, 3), in the frame of one light."""
    for axis in range(3):
        at = frames[axis, light] + offset * frames[3 + axis, light]
        normal, tangent, other = frames[3 + axis, light], frames[6 + axis, light], frames[9 + axis, light]
        for k in range(len(table)):
            origins[k, axis] = at
            directions[k, axis] = tangent * table[k, 0] + other * table[k, 1] + normal * table[k, 2]


@kernel
def _recall(
    texels: Texels,
    palette: IntArray,
    renumbered: IntArray,
    boxes: Float32Array,
    origins: Float32Array,
    directions: Float32Array,
    seen: IntArray,
) -> Int64Array:
    """What texels (n,) saw, by its present number, into `seen` (n,); returns those that must look again."""
    again = np.empty(len(texels), dtype=np.int64)
    count = 0
    for k in range(len(texels)):
        polygon = renumbered[palette[texels[k]]]
        looks = polygon < 0
        for box in range(len(boxes)):
            if looks:
                break
            near = 0.0
            far = np.inf
            for axis in range(3):
                along = directions[k, axis]
                low = boxes[box, 0, axis] - origins[k, axis]
                high = boxes[box, 1, axis] - origins[k, axis]
                if along == 0.0:
                    if low > 0.0 or high < 0.0:
                        far = -1.0
                    continue
                near = max(near, min(low / along, high / along))
                far = min(far, max(low / along, high / along))
            looks = near <= far
        if looks:
            again[count] = k
            count += 1
        else:
            seen[k] = polygon
    return again[:count]


@kernel
def number_polygons(seen: IntArray, number: IntArray, palette: IntArray, texels: Texels) -> int:
    """Number the polygons `seen` (n,) as they come; how many there are, nothing included.

    `number` (q + 1,) is 0, and is left so.
    """
    palette[0] = 0
    count = 1
    for k in range(len(seen)):
        polygon = seen[k]
        if polygon != 0 and number[polygon] == 0:
            number[polygon] = count
            palette[count] = polygon
            count += 1
        texels[k] = number[polygon]
    for k in range(count):
        number[palette[k]] = 0
    return count


@kernel
def _compare(texels: Texels, alike: Texels) -> None:
    last = texels.shape[1] - 1
    alike[:, last, :] = 0
    alike[:, :, last] = 0
    for light in range(len(texels)):
        for row in range(last):
            above, below = texels[light, row], texels[light, row + 1]
            for column in range(last):
                q = above[column]
                same = q == above[column + 1] and q == below[column] and q == below[column + 1]
                alike[light, row, column] = q if same else 0


@kernel
def span_cones(
    frames: Float32Array,
    start: IntArray,
    polygon: IntArray,
    corners: Float32Array,
    plane: Float32Array,
    cone: Float32Array,
) -> None:
    """The cones (s, 16) of all lights' polygons."""
    for light in range(len(start) - 1):
        for k in range(start[light], start[light + 1]):
            q = polygon[k]
            x, y, z = frames[0, light], frames[1, light], frames[2, light]
            side = plane[q, 0] * x + plane[q, 1] * y + plane[q, 2] * z - plane[q, 3]
            if q == 0 or abs(side) <= TOUCH:
                # Seen edge on: nothing is behind it.
                cone[k] = 0.0
                cone[k, 15] = 1.0
                continue
            sign = 1.0 if side < 0.0 else -1.0
            for axis in range(4):
                cone[k, 12 + axis] = sign * plane[q, axis]
            for edge in range(4):
                following = (edge + 1) & 3
                px, py, pz = corners[q, edge, 0] - x, corners[q, edge, 1] - y, corners[q, edge, 2] - z
                sx = corners[q, following, 0] - x
                sy = corners[q, following, 1] - y
                sz = corners[q, following, 2] - z
                cone[k, 3 * edge] = sign * (py * sz - pz * sy)
                cone[k, 3 * edge + 1] = sign * (pz * sx - px * sz)
                cone[k, 3 * edge + 2] = sign * (px * sy - py * sx)
