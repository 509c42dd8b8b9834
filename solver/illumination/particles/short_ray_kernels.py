"""Kernels of short rays: how they are drawn and aimed, and what is made of what they come upon."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.types import BoolArray, Float32Array, FloatArray, Int64Array, IntArray, Points, Vector
from solver.visibility.sampling import fraction_of, hash_index

BOUNCES: Final = 16
"""After so many rays in a row light is left out; each is short, and few meet anything."""

# First rays follow the plastic number's sequence (Roberts 2018), those after them the roots of 5 and 7: no
# sum of multiples of all four is whole, so that pairs of rays are even too. Later ones are random.
_FIRST: Final = 0.7548776662466927
_SECOND: Final = 0.5698402909980532
_FIRST_AFTER: Final = 0.2360679774997897
_SECOND_AFTER: Final = 0.6457513110645906
_UNIT: Final = 2.0**-31


class Patches(NamedTuple):
    """What a ray asks of the p patches that it meets, and of the t triangles that tell which they are."""

    triangle_patch: IntArray
    """(t, 2)"""
    corners: FloatArray
    """(p, 4, 3)"""
    normal: FloatArray
    """(p, 3)"""
    reflects: BoolArray
    """(p,) whether any light"""
    emits: BoolArray
    """(p,)"""
    emission_bound: FloatArray
    """(p,) local"""


class Found(NamedTuple):
    """What n rays come upon, at most, piece by piece."""

    row: Int64Array
    position: Points
    patch: IntArray
    along: FloatArray
    distance: FloatArray
    share: FloatArray
    emitted: FloatArray

    @classmethod
    def room(cls, n: int) -> Found:
        """For as many."""
        return cls(
            np.empty(n, dtype=np.int64), np.empty((n, 3)), np.empty(n, dtype=np.int32),
            np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n),
        )  # fmt: skip


@inline_kernel
def _numbers(stream: int, turn: int, bounce: int) -> tuple[float, float]:
    """Two numbers in [0, 1): for each bounce a sequence of its own, shifted for each stream."""
    h = hash_index(np.int64(stream) * BOUNCES + bounce)
    if bounce > 1:
        h = hash_index(h ^ np.int64(turn))
        turn = 0
    first, second = (_FIRST, _SECOND) if bounce == 0 else (_FIRST_AFTER, _SECOND_AFTER)
    return (
        fraction_of((h & 0x7FFFFFFF) * _UNIT + turn * first),
        fraction_of(((h >> 31) & 0x7FFFFFFF) * _UNIT + turn * second),
    )


@kernel
def draw(
    start: int,
    stop: int,
    patch: IntArray,
    normal: FloatArray,
    stream: Int64Array,
    turn: int,
    bounce: int,
    directions: FloatArray,
) -> None:
    """Cosine-distributed unit directions (n, 3) about the normals of patches (n,)."""
    for i in range(start, stop):
        u, v = _numbers(stream[i], turn, bounce)
        radius, angle = np.sqrt(u), 2.0 * np.pi * v
        a, b, c = radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - u)
        x, y, z = normal[patch[i], 0], normal[patch[i], 1], normal[patch[i], 2]
        # The frame of `tangent_frames`.
        sign = 1.0 if z >= 0.0 else -1.0
        p = -1.0 / (sign + z)
        q = x * y * p
        directions[i, 0] = a * (1.0 + sign * x * x * p) + b * q + c * x
        directions[i, 1] = a * sign * q + b * (sign + y * y * p) + c * y
        directions[i, 2] = -a * sign * x - b * y + c * z


@kernel
def aim(
    start: int,
    stop: int,
    positions: Points,
    patch: IntArray,
    normal: FloatArray,
    center: Vector,
    scale: float,
    offset: float,
    directions: FloatArray,
    bound: float,
    origins: Float32Array,
    along: Float32Array,
) -> None:
    """Local rays of the directions [start, stop), off their surfaces, and as long as may matter."""
    for i in range(start, stop):
        p = patch[i]
        cosine = 0.0
        for axis in range(3):
            cosine += directions[i, axis] * normal[p, axis]
        reach = np.sqrt(max(cosine, 0.0) / bound)
        for axis in range(3):
            at = (positions[i, axis] - center[axis]) * scale + offset * normal[p, axis]
            origins[i - start, axis] = at
            along[i - start, axis] = reach * directions[i, axis]


@kernel
def arrive(
    start: int,
    stop: int,
    triangle: IntArray,
    positions: Points,
    patch: IntArray,
    directions: FloatArray,
    patches: Patches,
    size: float,
    offset: float,
    bound: float,
    found: Found,
) -> int:
    """Write to `found`, from `start` on, what the rays [start, stop) come upon that matters; how much it is.

    Distances are those to planes: Embree's have seven digits of the scene's size.
    """
    count = 0
    normal, corners = patches.normal, patches.corners
    for i in range(start, stop):
        t = triangle[i - start]
        if t < 0:
            continue
        own, p = patch[i], patches.triangle_patch[t, 0]
        front = p
        here, falling, height = 0.0, 0.0, 0.0
        for axis in range(3):
            here += directions[i, axis] * normal[own, axis]
            falling += directions[i, axis] * normal[front, axis]
            at = positions[i, axis] + offset * size * normal[own, axis]
            height += (corners[front, 0, axis] - at) * normal[front, axis]
        if falling >= 0.0:
            p = patches.triangle_patch[t, 1]
        # Backs are black.
        if p < 0 or falling == 0.0:
            continue
        distance = max(height / falling, 0.0)
        far = max(distance, 1e-30) / size
        value = max(here * abs(falling) / (far * far), 1e-30)
        share = 1.0 - bound / value
        if not share > 0.0:
            continue
        emitted = max(1.0 - max(bound, patches.emission_bound[p]) / value, 0.0)
        if not (patches.reflects[p] or (patches.emits[p] and emitted > 0.0)):
            continue
        k = start + count
        found.row[k] = i
        found.patch[k] = p
        for axis in range(3):
            at = positions[i, axis] + offset * size * normal[own, axis]
            found.position[k, axis] = at + distance * directions[i, axis]
            found.along[k, axis] = directions[i, axis]
        found.distance[k] = distance
        found.share[k] = share
        found.emitted[k] = emitted
        count += 1
    return count


@kernel
def by_patch(begin: Int64Array, end: Int64Array, patch: IntArray, patches: int) -> Int64Array:
    """The indices of all pieces [begin, end) (m,), ordered by patch, those of one patch as they are."""
    place = np.zeros(patches + 1, dtype=np.int64)
    for piece in range(len(begin)):
        for i in range(begin[piece], end[piece]):
            place[patch[i] + 1] += 1
    for p in range(patches):
        place[p + 1] += place[p]
    order = np.empty(place[patches], dtype=np.int64)
    for piece in range(len(begin)):
        for i in range(begin[piece], end[piece]):
            order[place[patch[i]]] = i
            place[patch[i]] += 1
    return order
