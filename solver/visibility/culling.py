"""Many polygons against one shaft at once: lanes of 64 polygons, so that the loops over them vectorise."""

from __future__ import annotations

from typing import Final

from solver.kernels import kernel
from solver.types import ByteArray, Corners, FloatArray, IntArray

LANES: Final = 64
"""Polygons side by side in a block."""

BLOCK: Final = 16 * LANES
"""Numbers in a block: coordinates of four corners, normal and its offset, a row of LANES each."""

OUTSIDE: Final = 0
REACHES_IN: Final = 1
MAY_COVER: Final = 2
"""What a polygon is to a pair: cannot block it, may block some of it, may hide all of it."""


@kernel
def gather_blocks(
    corners: Corners, normals: FloatArray, chosen: IntArray, start: int, count: int, blocks: FloatArray
) -> None:
    """Lay out the polygons chosen[start : start + count] in blocks of LANES (BLOCK * b,)."""
    for k in range(count):
        polygon = chosen[start + k]
        at = k // LANES * BLOCK + k % LANES
        for corner in range(4):
            for axis in range(3):
                blocks[at] = corners[polygon, corner, axis]
                at += LANES
        offset = 0.0
        for axis in range(3):
            blocks[at] = normals[polygon, axis]
            offset += normals[polygon, axis] * corners[polygon, 0, axis]
            at += LANES
        blocks[at] = offset


@kernel
def cull_block(
    block: FloatArray,
    count: int,
    first: FloatArray,
    second: FloatArray,
    planes: FloatArray,
    plane_count: int,
    tolerance: float,
    work: FloatArray,
    verdict: ByteArray,
) -> None:
    """What each of the `count` polygons of a block (BLOCK,) is to a pair of elements (4, 3).

    planes (p, 4) bound the pair's shaft; work is (5 * LANES,), verdict (LANES,). Triangles repeat a corner.
    """
    for k in range(count):
        work[k] = 1e300
    for p in range(plane_count):
        a = planes[p, 0]
        b = planes[p, 1]
        c = planes[p, 2]
        d = planes[p, 3]
        for k in range(count):
            reach = a * block[k] + b * block[LANES + k] + c * block[2 * LANES + k]
            reach = max(reach, a * block[3 * LANES + k] + b * block[4 * LANES + k] + c * block[5 * LANES + k])
            reach = max(reach, a * block[6 * LANES + k] + b * block[7 * LANES + k] + c * block[8 * LANES + k])
            reach = max(
                reach, a * block[9 * LANES + k] + b * block[10 * LANES + k] + c * block[11 * LANES + k]
            )
            work[k] = min(work[k], reach - d)
    for end in range(2):
        element = first if end == 0 else second
        low = work[(1 + 2 * end) * LANES : (2 + 2 * end) * LANES]
        high = work[(2 + 2 * end) * LANES : (3 + 2 * end) * LANES]
        for corner in range(4):
            x = element[corner, 0]
            y = element[corner, 1]
            z = element[corner, 2]
            for k in range(count):
                height = block[12 * LANES + k] * x + block[13 * LANES + k] * y + block[14 * LANES + k] * z
                height -= block[15 * LANES + k]
                low[k] = height if corner == 0 else min(low[k], height)
                high[k] = height if corner == 0 else max(high[k], height)
    for k in range(count):
        low1 = work[LANES + k]
        high1 = work[2 * LANES + k]
        low2 = work[3 * LANES + k]
        high2 = work[4 * LANES + k]
        if work[k] <= tolerance or max(high1, high2) <= tolerance or min(low1, low2) >= -tolerance:
            verdict[k] = OUTSIDE
        elif (low1 > tolerance and high2 < -tolerance) or (high1 < -tolerance and low2 > tolerance):
            verdict[k] = MAY_COVER
        else:
            verdict[k] = REACHES_IN
