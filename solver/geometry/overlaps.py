"""Faces that lie in one place: what comes later lies on what came before, and hides it.

Two faces that shine to one side from the same place, or from so near that rays, which leave their surfaces by
`tolerances.RAY_OFFSET`, cannot tell them apart, would both be lit by the same light, and shown by turns. So
the one beneath is cut away where the other covers it: the farther back one, and of two in one plane the one
that comes earlier in the scene. Faces that turn their backs to each other, or their fronts, stay as they are.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.subtraction import subtract
from solver.kernels import kernel
from solver.types import BoolArray, Corners, FloatArray, Int64Array, IntArray, Vector

_KEY: Final[FloatArray] = np.array([0.755, 0.570, 0.430, 0.819, 0.671, 0.549, 0.857, 0.734, 0.629])
"""Weights of what planes are sorted by: no two planes that matter are likely to agree in it by chance."""

_WINDOW: Final = 1e-4
"""Planes whose keys differ by more are different."""

_SWEEP: Final[FloatArray] = np.array([0.61, 0.53, 0.59])
"""Direction in which faces are swept over: along no wall, so that the tiles of any are met one by one."""


def find_covers(
    corners: Corners, counts: IntArray, normals: FloatArray, two_sided: BoolArray, center: Vector, size: float
) -> tuple[IntArray, IntArray]:
    """Pairs (covered, cover), m each, of faces (p, 4, 3) that lie in one place; by `covered`.

    Of a scene with a diameter of `size` metres around `center`; faces come in the order of the scene.
    """
    local = corners - center
    offset = np.einsum("pi,pi->p", normals, local[:, 0]) / size
    x, y, z = normals.T
    told = [x * x, y * y, z * z, x * y, y * z, z * x, offset * x, offset * y, offset * z]
    key = np.sum(_KEY[:, None] * np.stack(told), axis=0)
    low, high = local.min(axis=1), local.max(axis=1)
    along = local @ _SWEEP
    start, stop = along.min(axis=1), along.max(axis=1)
    gap, margin = tolerances.RAY_OFFSET * size, tolerances.TOUCH * size
    # Planes that agree share a slot of the one kind or the other; within slots, faces are swept over.
    slots = [np.floor(0.5 * key / _WINDOW + shift).astype(np.int64) for shift in (0.0, 0.5)]
    pairs = [
        _find(
            np.lexsort((start, slot)), slot, known, start, stop, low, high, local, counts, normals, two_sided,
            gap, tolerances.SIDE * size, margin,
        )
        for slot, known in ((slots[0], np.arange(len(key))), (slots[1], slots[0]))
    ]  # fmt: skip
    found = np.concatenate(pairs)
    found = found[np.lexsort((found[:, 1], found[:, 0]))]
    return found[:, 0], found[:, 1]


def cut_covered(
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    covered: IntArray,
    cover: IntArray,
    margin: float,
) -> dict[int, tuple[Corners, IntArray]]:
    """What is left of each of the covered faces: corners (m, 4, 3) and how many there are (m,)."""
    left = {}
    for face in np.unique(covered).tolist():
        over = cover[covered == face]
        # Far from the origin, small pieces keep their digits about the face's own corner.
        origin = corners[face, 0]
        pieces, count = subtract(
            corners[face] - origin, counts[face], normals[face], corners[over] - origin, counts[over],
            np.arange(len(over), dtype=np.int32), margin,
        )  # fmt: skip
        left[face] = (pieces + origin, count)
    return left


@kernel
def _find(
    order: Int64Array,
    slot: Int64Array,
    known: Int64Array,
    start: FloatArray,
    stop: FloatArray,
    low: FloatArray,
    high: FloatArray,
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    two_sided: BoolArray,
    gap: float,
    tie: float,
    margin: float,
) -> IntArray:
    """Pairs (m, 2) of the face that is covered and the one that covers it.

    Of faces of one `slot` (p,), in `order` of these and of where they `start` along the sweep; but not of
    those that are `known` (p,) alike, which have been looked at.
    """
    found = np.empty((16, 2), dtype=np.int32)
    made = 0
    for first in range(len(order)):
        one = order[first]
        for at in range(first + 1, len(order)):
            other = order[at]
            if slot[other] != slot[one] or start[other] > stop[one] + gap:
                break
            if known[other] == known[one]:
                continue
            a = min(one, other)
            b = max(one, other)
            apart = False
            for axis in range(3):
                if low[a, axis] > high[b, axis] + gap or low[b, axis] > high[a, axis] + gap:
                    apart = True
            if apart:
                continue
            beneath = _beneath(a, b, corners, counts, normals, two_sided, gap, tie)
            if beneath < 0 or not _overlap(a, b, corners, counts, normals, margin):
                continue
            if made == len(found):
                larger = np.empty((2 * made, 2), dtype=np.int32)
                larger[:made] = found
                found = larger
            found[made, 0] = beneath
            found[made, 1] = b if beneath == a else a
            made += 1
    return found[:made]


@kernel
def _beneath(
    a: int,
    b: int,
    corners: Corners,
    counts: IntArray,
    normals: FloatArray,
    two_sided: BoolArray,
    gap: float,
    tie: float,
) -> int:
    """Which of the faces a < b lies beneath the other if they overlap; -1 where that is no matter."""
    cosine = 0.0
    for axis in range(3):
        cosine += normals[a, axis] * normals[b, axis]
    # To which side of a, as its normal goes, do both shine?
    front = two_sided[b] or cosine > 0.0
    back = two_sided[a] and (two_sided[b] or cosine < 0.0)
    if not (front or back):
        return -1
    over_a, reach_b = _heights(a, b, corners, counts, normals)
    over_b, reach_a = _heights(b, a, corners, counts, normals)
    if min(reach_a, reach_b) > gap:
        return -1
    height = over_a if reach_b <= reach_a else (-over_b if cosine > 0.0 else over_b)
    if abs(height) <= tie or (front and back):
        return a
    return a if (height > 0.0) == front else b


@kernel
def _heights(a: int, b: int, corners: Corners, counts: IntArray, normals: FloatArray) -> tuple[float, float]:
    """How far b is over a's plane: on average, and its farthest corner, either way."""
    mean = 0.0
    farthest = 0.0
    for k in range(counts[b]):
        height = 0.0
        for axis in range(3):
            height += normals[a, axis] * (corners[b, k, axis] - corners[a, 0, axis])
        mean += height / counts[b]
        farthest = max(farthest, abs(height))
    return mean, farthest


@kernel
def _overlap(a: int, b: int, corners: Corners, counts: IntArray, normals: FloatArray, margin: float) -> bool:
    """Whether two convex faces of one plane have more in common than a strip of `margin`."""
    for turn in range(2):
        one = a if turn == 0 else b
        other = b if turn == 0 else a
        for k in range(counts[one]):
            m = (k + 1) % counts[one]
            ex = corners[one, m, 0] - corners[one, k, 0]
            ey = corners[one, m, 1] - corners[one, k, 1]
            ez = corners[one, m, 2] - corners[one, k, 2]
            sx = ez * normals[one, 1] - ey * normals[one, 2]
            sy = ex * normals[one, 2] - ez * normals[one, 0]
            sz = ey * normals[one, 0] - ex * normals[one, 1]
            length = np.sqrt(sx * sx + sy * sy + sz * sz)
            deepest = -margin
            for j in range(counts[other]):
                inward = (
                    sx * (corners[other, j, 0] - corners[one, k, 0])
                    + sy * (corners[other, j, 1] - corners[one, k, 1])
                    + sz * (corners[other, j, 2] - corners[one, k, 2])
                )
                deepest = max(deepest, inward / length)
            if deepest <= margin:
                return False
    return True
