"""Contact discontinuities: where polygons touch or cross a receiver, whatever lights it ([H 5.2, 5.5.3]).

Irradiance jumps there. Candidates come from the hierarchy of polygons: those that reach into the slab
around the receiver's plane, within its sides.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.illumination.discontinuity.outlines import FLAT, Outlines
from solver.illumination.discontinuity.segments import (
    CONTACT,
    SAMPLES,
    Polygons,
    clip_to_sides,
    counts_as_segment,
    patch_diameter,
    receiver_planes,
    write_segment,
)
from solver.kernels import kernel
from solver.transport.exchange import heights
from solver.types import FloatArray, IntArray
from solver.visibility.bvh import walk_hierarchy

_SLAB: Final = 2.0
"""Half the thickness of the slab, in tolerances."""


@kernel
def _slab_planes(planes: FloatArray, sides: int, o: FloatArray, tolerance: float, slab: FloatArray) -> int:
    """Planes (a, b, c, d), inside where ax + by + cz >= d in the world, of what may touch the receiver."""
    for k in range(2 + sides):
        row = max(0, k - 1)
        sign = -1.0 if k == 1 else 1.0
        offset = planes[row, 3]
        for axis in range(3):
            slab[k, axis] = sign * planes[row, axis]
            offset += planes[row, axis] * o[axis]
        slab[k, 3] = sign * offset - (_SLAB * tolerance if k < 2 else 0.0)
    return 2 + sides


@kernel
def cross_plane(polygons: Polygons, c: int, o: FloatArray, normal: FloatArray, segment: FloatArray) -> bool:
    """The segment (2, 3) in which patch c crosses the plane through o; whether there is one."""
    found = 0
    n = polygons.counts[c]
    for k in range(n):
        a = polygons.corners[c, k]
        b = polygons.corners[c, (k + 1) % n]
        h0 = normal[0] * (a[0] - o[0]) + normal[1] * (a[1] - o[1]) + normal[2] * (a[2] - o[2])
        h1 = normal[0] * (b[0] - o[0]) + normal[1] * (b[1] - o[1]) + normal[2] * (b[2] - o[2])
        if (h0 > 0.0) == (h1 > 0.0):
            continue
        t = h0 / (h0 - h1)
        if found < 2:
            for axis in range(3):
                segment[found, axis] = a[axis] + t * (b[axis] - a[axis])
        found += 1
    return found == 2


@kernel
def _touches(outlines: Outlines, e: int, o: FloatArray, normal: FloatArray, tolerance: float) -> bool:
    """Whether an edge lies on a plane and is where something on the plane or in front of it ends.

    What meets the plane from behind alone, or lies flush in it as the top of what is behind, changes
    nothing in front. Inner edges of what lies on the plane end nothing.
    """
    for end in range(2):
        w = outlines.ends[e, end]
        h = 0.0
        for axis in range(3):
            h += normal[axis] * (outlines.point[w, axis] - o[axis])
        if abs(h) > tolerance:
            return False
    a = outlines.point[outlines.ends[e, 0]]
    b = outlines.point[outlines.ends[e, 1]]
    dx = b[0] - a[0]
    dy = b[1] - a[1]
    dz = b[2] - a[2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    behind = False
    for i in range(outlines.sheet_start[e], outlines.sheet_start[e + 1]):
        # The direction in which the sheet leaves the edge is its turned normal x the edge.
        t = outlines.sheet_normal[i]
        rises = (
            normal[0] * (t[1] * dz - t[2] * dy)
            + normal[1] * (t[2] * dx - t[0] * dz)
            + normal[2] * (t[0] * dy - t[1] * dx)
        ) / length
        if rises > FLAT:
            return True
        if rises < -FLAT:
            behind = True
    return not behind and not outlines.is_flat[e]


@kernel
def _write_contact(
    polygons: Polygons,
    r: int,
    c: int,
    planes: FloatArray,
    sides: int,
    size: float,
    segment: FloatArray,
    used: int,
    rows: FloatArray,
    ids: IntArray,
) -> int:
    """Clip a segment (2, 3), from the receiver's first corner, and write what counts; 1 if anything does."""
    if not clip_to_sides(planes, sides, segment) or not counts_as_segment(planes, sides, segment, size):
        return 0
    write_segment(polygons, r, -1, c, CONTACT, segment, used, rows, ids)
    rows[used, 6] = math.inf
    for sample in range(SAMPLES):
        rows[used, 7 + sample] = 0.0
        rows[used, 7 + SAMPLES + sample] = 0.0
        rows[used, 7 + 2 * SAMPLES + sample] = math.inf
    return 1


@kernel
def find_contacts(
    polygons: Polygons,
    outlines: Outlines,
    low: FloatArray,
    high: FloatArray,
    skip: IntArray,
    leaf_first: IntArray,
    leaf_count: IntArray,
    order: IntArray,
    receivers: IntArray,
    tolerance: float,
    begin: int,
    rows: FloatArray,
    ids: IntArray,
) -> tuple[int, int]:
    """Write the contacts of the receivers from `begin` on to rows (m, FIELDS), ids (m, 4).

    The hierarchy's arrays are those of `Hierarchy`; tolerance in metres. Returns the number of rows
    written and the receiver at which they were full.
    """
    planes = np.empty((5, 4))
    slab = np.empty((6, 4))
    candidates = np.empty(len(order), dtype=np.int32)
    taken = np.full(len(outlines.ends), -1, dtype=np.int32)
    segment = np.empty((2, 3))
    used = 0
    for i in range(begin, len(receivers)):
        r = receivers[i]
        before = used
        sides = receiver_planes(polygons, r, planes)
        size = patch_diameter(polygons, r)
        o = polygons.corners[r, 0]
        normal = polygons.normals[r]
        slab_count = _slab_planes(planes, sides, o, tolerance, slab)
        found = walk_hierarchy(
            low, high, skip, leaf_first, leaf_count, order, slab, slab_count, tolerance, candidates
        )
        for entry in range(found):
            c = candidates[entry]
            if c == r:
                continue
            lowest, highest = heights(polygons.corners[c], polygons.counts[c], o, normal)
            if lowest < -tolerance and highest > tolerance:
                # It crosses the receiver's plane.
                if not cross_plane(polygons, c, o, normal, segment):
                    continue
                for end in range(2):
                    for axis in range(3):
                        segment[end, axis] -= o[axis]
                if used == len(rows):
                    return before, i
                used += _write_contact(polygons, r, c, planes, sides, size, segment, used, rows, ids)
                continue
            # Or some of its edges lie on it.
            for k in range(polygons.counts[c]):
                e = outlines.edge[c, k]
                if e < 0 or taken[e] == i or not _touches(outlines, e, o, normal, tolerance):
                    continue
                taken[e] = i
                for end in range(2):
                    for axis in range(3):
                        segment[end, axis] = outlines.point[outlines.ends[e, end], axis] - o[axis]
                if used == len(rows):
                    return before, i
                used += _write_contact(polygons, r, c, planes, sides, size, segment, used, rows, ids)
    return used, len(receivers)
