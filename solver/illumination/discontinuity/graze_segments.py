"""Grazing discontinuities: lines from which a blocker is seen edge-on, with a part of the source behind it.

Where a polygon's plane meets receiver and source, a point that crosses it sees the polygon from the other
side, or the near edge of a box take over from the far one as what bounds its shadow. The edge of the shadow
moves on at another speed: the first derivative jumps, as at a horizon. These are the planes of quadrilaterals
that split others in [H 5.5.3], weighed by the source behind them.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.illumination.discontinuity.contact_segments import cross_plane
from solver.illumination.discontinuity.outlines import Outlines
from solver.illumination.discontinuity.segments import (
    GRAZE,
    SAMPLES,
    Polygons,
    clip,
    counts_as_segment,
    height,
    patch_diameter,
    receiver_planes,
    write_segment,
)
from solver.illumination.discontinuity.wedges import (
    HEIGHTS,
    know_heights,
    meet_receiver,
    shadow_of_edge,
    shadow_of_vertex,
)
from solver.kernels import kernel
from solver.transport.exchange import heights
from solver.transport.lambert import point_form_factor
from solver.types import FloatArray, IntArray

_LINES: Final = 8
"""Sight lines to the source by which a polygon's effect is summed up."""


@kernel
def _is_open(outlines: Outlines, c: int, count: int) -> bool:
    """Whether a patch has an edge that bounds no other."""
    for k in range(count):
        e = outlines.edge[c, k]
        if e >= 0 and outlines.sheet_start[e + 1] - outlines.sheet_start[e] == 1:
            return True
    return False


@kernel
def _in_front(segment: FloatArray, o: FloatArray, planes: FloatArray, tolerance: float) -> bool:
    """Clip a segment (2, 3) to what is in front of the receiver's plane, in place; whether any of it is."""
    h0 = height(planes, 0, segment[0, 0] - o[0], segment[0, 1] - o[1], segment[0, 2] - o[2])
    h1 = height(planes, 0, segment[1, 0] - o[0], segment[1, 1] - o[1], segment[1, 2] - o[2])
    t0, t1 = clip(h0 - tolerance, h1 - tolerance, 0.0, 1.0)
    if t0 >= t1:
        return False
    for axis in range(3):
        a = segment[0, axis]
        step = segment[1, axis] - a
        segment[0, axis] = a + t0 * step
        segment[1, axis] = a + t1 * step
    return True


@kernel
def _reach(
    wedge: FloatArray, planes: FloatArray, o: FloatArray, is_ev: bool, line: FloatArray, reached: FloatArray
) -> None:
    """Widen reached (2,) to where on a line (2, 3) the lines through apex and base's ends of a wedge lead."""
    x = np.empty(3)
    for end in range(2):
        meet_receiver(wedge, float(end), planes, o, is_ev, x)
        t = 0.0
        square = 0.0
        for axis in range(3):
            step = line[1, axis] - line[0, axis]
            t += (x[axis] + o[axis] - line[0, axis]) * step
            square += step * step
        reached[0] = min(reached[0], t / square)
        reached[1] = max(reached[1], t / square)


@kernel
def _shaded_part(
    polygons: Polygons,
    r: int,
    s: int,
    c: int,
    planes: FloatArray,
    line: FloatArray,
    across: FloatArray,
    tolerance: float,
) -> tuple[float, float]:
    """The part [t0, t1] of a line (2, 3) on the receiver that patch c shades from one (2, 3) on the source.

    All three lie in the patch's plane. The shade ends where an end of the source's line and a corner of the
    patch point, or at infinity, where the one is as high over the receiver as a point of the other.
    """
    n = polygons.counts[c]
    o = polygons.corners[r, 0]
    source_heights = np.empty((2, HEIGHTS))
    a = np.empty(HEIGHTS)
    b = np.empty(HEIGHTS)
    wedge = np.empty((3, 3))
    reached = np.array([math.inf, -math.inf])
    for end in range(2):
        know_heights(polygons, r, s, planes, 0, across[end], source_heights[end])
    for k in range(n):
        m = (k + 1) % n
        know_heights(polygons, r, s, planes, 0, polygons.corners[c, k], a)
        know_heights(polygons, r, s, planes, 0, polygons.corners[c, m], b)
        for end in range(2):
            t0, t1 = shadow_of_edge(source_heights[end], a, b, 0, tolerance)
            if t0 < t1:
                for axis in range(3):
                    step = polygons.corners[c, m, axis] - polygons.corners[c, k, axis]
                    wedge[0, axis] = across[end, axis]
                    wedge[1, axis] = polygons.corners[c, k, axis] + t0 * step
                    wedge[2, axis] = polygons.corners[c, k, axis] + t1 * step
                _reach(wedge, planes, o, False, line, reached)
        t0, t1 = shadow_of_vertex(source_heights[0], source_heights[1], a, 0, tolerance)
        if t0 < t1:
            for axis in range(3):
                step = across[1, axis] - across[0, axis]
                wedge[0, axis] = polygons.corners[c, k, axis]
                wedge[1, axis] = across[0, axis] + t0 * step
                wedge[2, axis] = across[0, axis] + t1 * step
            _reach(wedge, planes, o, True, line, reached)
    return max(0.0, reached[0]), min(1.0, reached[1])


@kernel
def _graze_strength(
    polygons: Polygons, r: int, s: int, c: int, x: FloatArray, across: FloatArray, tolerance: float
) -> tuple[float, float]:
    """Form factor at x, and the width over which it would go at the rate by which its slope jumps, m.

    A sight line in the patch's plane enters it at d1, leaves it at d2 and meets the source at ds. Let x rise
    by 1 over the plane: what the edges at d1 and d2 hide of the source moves by ds / d1 - 1 and ds / d2 - 1.
    """
    nr = polygons.normals[r]
    ns = polygons.normals[s]
    nc = polygons.normals[c]
    n = polygons.counts[c]
    factor = point_form_factor(
        x[0], x[1], x[2], nr[0], nr[1], nr[2], polygons.corners[s], polygons.counts[s], np.empty((8, 3))
    )
    length = 0.0
    for axis in range(3):
        length += (across[1, axis] - across[0, axis]) ** 2
    length = math.sqrt(length)
    total = 0.0
    k = np.empty(3)
    for sight in range(_LINES):
        t = (sight + 0.5) / _LINES
        for axis in range(3):
            k[axis] = across[0, axis] + t * (across[1, axis] - across[0, axis]) - x[axis]
        ds = math.sqrt(k[0] ** 2 + k[1] ** 2 + k[2] ** 2)
        if ds <= tolerance:
            continue
        for axis in range(3):
            k[axis] /= ds
        sinks = ns[0] * k[0] + ns[1] * k[1] + ns[2] * k[2]
        if sinks >= 0.0:
            continue
        d1 = tolerance
        d2 = ds
        for corner in range(n):
            a = polygons.corners[c, corner]
            b = polygons.corners[c, (corner + 1) % n]
            ex = b[0] - a[0]
            ey = b[1] - a[1]
            ez = b[2] - a[2]
            mx = nc[1] * ez - nc[2] * ey
            my = nc[2] * ex - nc[0] * ez
            mz = nc[0] * ey - nc[1] * ex
            here = mx * (x[0] - a[0]) + my * (x[1] - a[1]) + mz * (x[2] - a[2])
            grows = mx * k[0] + my * k[1] + mz * k[2]
            if grows > 0.0:
                d1 = max(d1, -here / grows)
            elif grows < 0.0:
                d2 = min(d2, -here / grows)
            elif here < 0.0:
                d2 = 0.0
        if d1 >= d2:
            continue
        cosine = max(0.0, nr[0] * k[0] + nr[1] * k[1] + nr[2] * k[2])
        density = cosine * -sinks / (math.pi * ds * ds)
        total += density * (ds / d1 - ds / d2) * length / _LINES
    cosine_r = nc[0] * nr[0] + nc[1] * nr[1] + nc[2] * nr[2]
    cosine_s = nc[0] * ns[0] + nc[1] * ns[1] + nc[2] * ns[2]
    slope = total * math.sqrt(max(0.0, 1.0 - cosine_r * cosine_r) / max(tolerance, 1.0 - cosine_s * cosine_s))
    return factor, factor / slope if slope > 0.0 else math.inf


@kernel
def find_grazes(
    polygons: Polygons,
    outlines: Outlines,
    receivers: IntArray,
    sources: IntArray,
    blocker_count: IntArray,
    pool: IntArray,
    tolerance: float,
    rows: FloatArray,
    ids: IntArray,
) -> int:
    """Write the grazing discontinuities of n pairs to rows (>= blockers, FIELDS), ids (>= blockers, 4).

    pool holds the pairs' blockers one after the other; tolerance in metres. Returns the number of rows
    written.
    """
    planes = np.empty((5, 4))
    segment, line, across = np.empty((3, 2, 3))
    used = 0
    first = 0
    for pair in range(len(receivers)):
        r = receivers[pair]
        s = sources[pair]
        sides = receiver_planes(polygons, r, planes)
        size = patch_diameter(polygons, r)
        o = polygons.corners[r, 0]
        for entry in range(first, first + blocker_count[pair]):
            c = pool[entry]
            nc = polygons.normals[c]
            at = polygons.corners[c, 0]
            low, high = heights(polygons.corners[s], polygons.counts[s], at, nc)
            if low >= -tolerance or high <= tolerance:
                continue
            low, high = heights(polygons.corners[r], polygons.counts[r], at, nc)
            if low >= -tolerance or high <= tolerance:
                continue
            # The lines in which the polygon's plane meets the receiver and the source.
            if not cross_plane(polygons, s, at, nc, across) or not cross_plane(polygons, r, at, nc, line):
                continue
            if not _in_front(across, o, planes, tolerance):
                continue
            t0, t1 = _shaded_part(polygons, r, s, c, planes, line, across, tolerance)
            if t0 >= t1:
                continue
            for axis in range(3):
                step = line[1, axis] - line[0, axis]
                segment[0, axis] = line[0, axis] + t0 * step - o[axis]
                segment[1, axis] = line[0, axis] + t1 * step - o[axis]
            if not counts_as_segment(planes, sides, segment, size):
                continue
            write_segment(polygons, r, s, c, GRAZE, segment, used, rows, ids)
            rows[used, 6] = 1.0
            open_sheet = _is_open(outlines, c, polygons.counts[c])
            for sample in range(SAMPLES):
                t = t0 + (t1 - t0) * sample / (SAMPLES - 1.0)
                x = line[0] + t * (line[1] - line[0])
                factor, width = _graze_strength(polygons, r, s, c, x, across, tolerance)
                rows[used, 7 + sample] = factor
                # Of an open sheet one side hides as much as the other.
                rows[used, 7 + SAMPLES + sample] = 0.5 * width if open_sheet else width
                rows[used, 7 + 2 * SAMPLES + sample] = math.inf
            used += 1
        first += blocker_count[pair]
    return used
