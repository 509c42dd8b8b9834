"""Which parts of a wedge of sight lines are free: discontinuities that nothing sees are none.

A VE or EV discontinuity is a plane wedge of lines, from the source past the blocker to the receiver, that
meet in an apex: the source's vertex, or the blocker's. Any other polygon cuts the wedge's plane in a
segment, which hides the lines between its ends as they are seen from the apex: an interval of the wedge's
base, exact up to rounding. [H 5.5.3] keeps the hidden parts too. What only touches a line does not hide it,
so that rounding errs to the side of keeping.
"""

from __future__ import annotations

from typing import Final

from solver.illumination.discontinuity.outlines import Outlines
from solver.illumination.discontinuity.segments import Polygons, clip
from solver.kernels import kernel
from solver.types import FloatArray, IntArray

_AT_APEX: Final = 1e-9
"""What is closer to the apex than this part of the distance to the base hides no line."""


@kernel
def _over(polygons: Polygons, c: int, k: int, wedge: FloatArray, normal: FloatArray) -> float:
    """Height of corner k of a patch over the wedge's plane."""
    return float(
        normal[0] * (polygons.corners[c, k, 0] - wedge[0, 0])
        + normal[1] * (polygons.corners[c, k, 1] - wedge[0, 1])
        + normal[2] * (polygons.corners[c, k, 2] - wedge[0, 2])
    )


@kernel
def _holds(polygons: Polygons, c: int, x: FloatArray, tolerance: float) -> bool:
    """Whether a point (3,) lies on a patch, more than `tolerance` from its border."""
    normal = polygons.normals[c]
    n = polygons.counts[c]
    for k in range(n):
        a = polygons.corners[c, k]
        b = polygons.corners[c, (k + 1) % n]
        px = x[0] - a[0]
        py = x[1] - a[1]
        pz = x[2] - a[2]
        if k == 0 and abs(normal[0] * px + normal[1] * py + normal[2] * pz) > tolerance:
            return False
        ex = b[0] - a[0]
        ey = b[1] - a[1]
        ez = b[2] - a[2]
        left = (
            normal[0] * (ey * pz - ez * py)
            + normal[1] * (ez * px - ex * pz)
            + normal[2] * (ex * py - ey * px)
        )
        if left <= 0.0 or left * left <= tolerance * tolerance * (ex * ex + ey * ey + ez * ez):
            return False
    return True


@kernel
def _hide(
    polygons: Polygons,
    c: int,
    wedge: FloatArray,
    normal: FloatArray,
    is_ev: bool,
    receiver: int,
    source: int,
    tolerance: float,
    hidden: FloatArray,
    intervals: int,
) -> int:
    """Append the intervals of the base that patch c hides to hidden[intervals:]; returns their number.

    A point of the wedge's plane is apex + a (base 0 - apex) + b (base 1 - apex): it is on the line to
    b / (a + b) of the base, on the base's side of the apex where a + b > 0.
    """
    ux = wedge[1, 0] - wedge[0, 0]
    uy = wedge[1, 1] - wedge[0, 1]
    uz = wedge[1, 2] - wedge[0, 2]
    vx = wedge[2, 0] - wedge[0, 0]
    vy = wedge[2, 1] - wedge[0, 1]
    vz = wedge[2, 2] - wedge[0, 2]
    turned = (
        normal[0] * (uy * vz - uz * vy) + normal[1] * (uz * vx - ux * vz) + normal[2] * (ux * vy - uy * vx)
    )
    # The segment in which the polygon cuts the plane: a convex one has two crossings.
    found = 0
    sums0 = 0.0
    sums1 = 0.0
    ratio0 = 0.0
    ratio1 = 0.0
    over_receiver0 = 0.0
    over_receiver1 = 0.0
    over_source0 = 0.0
    over_source1 = 0.0
    n = polygons.counts[c]
    r = polygons.corners[receiver, 0]
    s = polygons.corners[source, 0]
    nr = polygons.normals[receiver]
    ns = polygons.normals[source]
    for k in range(n):
        m = (k + 1) % n
        h0 = _over(polygons, c, k, wedge, normal)
        h1 = _over(polygons, c, m, wedge, normal)
        if (h0 > 0.0) == (h1 > 0.0):
            continue
        t = h0 / (h0 - h1)
        x = polygons.corners[c, k, 0] + t * (polygons.corners[c, m, 0] - polygons.corners[c, k, 0])
        y = polygons.corners[c, k, 1] + t * (polygons.corners[c, m, 1] - polygons.corners[c, k, 1])
        z = polygons.corners[c, k, 2] + t * (polygons.corners[c, m, 2] - polygons.corners[c, k, 2])
        px = x - wedge[0, 0]
        py = y - wedge[0, 1]
        pz = z - wedge[0, 2]
        a = (
            normal[0] * (py * vz - pz * vy)
            + normal[1] * (pz * vx - px * vz)
            + normal[2] * (px * vy - py * vx)
        )
        b = (
            normal[0] * (uy * pz - uz * py)
            + normal[1] * (uz * px - ux * pz)
            + normal[2] * (ux * py - uy * px)
        )
        sums1 = (a + b) / turned
        ratio1 = b / turned
        over_receiver1 = nr[0] * (x - r[0]) + nr[1] * (y - r[1]) + nr[2] * (z - r[2])
        over_source1 = ns[0] * (x - s[0]) + ns[1] * (y - s[1]) + ns[2] * (z - s[2])
        if found == 0:
            sums0 = sums1
            ratio0 = ratio1
            over_receiver0 = over_receiver1
            over_source0 = over_source1
        found += 1
    if found < 2:
        return intervals
    # Only what is in front of both ends of the sight lines is between them.
    t0, t1 = clip(over_receiver0 - tolerance, over_receiver1 - tolerance, 0.0, 1.0)
    t0, t1 = clip(over_source0 - tolerance, over_source1 - tolerance, t0, t1)
    for side in range(2 if is_ev else 1):
        sign = 1.0 if side == 0 else -1.0
        a0, a1 = clip(sign * sums0 - _AT_APEX, sign * sums1 - _AT_APEX, t0, t1)
        if a0 >= a1:
            continue
        start = (ratio0 + a0 * (ratio1 - ratio0)) / (sums0 + a0 * (sums1 - sums0))
        stop = (ratio0 + a1 * (ratio1 - ratio0)) / (sums0 + a1 * (sums1 - sums0))
        low = max(0.0, min(start, stop))
        high = min(1.0, max(start, stop))
        if low < high:
            hidden[intervals, 0] = low
            hidden[intervals, 1] = high
            intervals += 1
    return intervals


@kernel
def _complement(hidden: FloatArray, intervals: int, parts: FloatArray) -> int:
    """What the intervals (n, 2) leave of [0, 1], ascending; sorts them in place, returns the number left."""
    for i in range(1, intervals):
        low = hidden[i, 0]
        high = hidden[i, 1]
        j = i
        while j > 0 and hidden[j - 1, 0] > low:
            hidden[j, 0] = hidden[j - 1, 0]
            hidden[j, 1] = hidden[j - 1, 1]
            j -= 1
        hidden[j, 0] = low
        hidden[j, 1] = high
    free = 0
    reached = 0.0
    for i in range(intervals):
        if hidden[i, 0] > reached:
            parts[free, 0] = reached
            parts[free, 1] = hidden[i, 0]
            free += 1
        reached = max(reached, hidden[i, 1])
    if reached < 1.0:
        parts[free, 0] = reached
        parts[free, 1] = 1.0
        free += 1
    return free


@kernel
def gather_spheres(polygons: Polygons, pool: IntArray, first: int, count: int, spheres: FloatArray) -> None:
    """Middles and radii around the blockers pool[first : first + count], side by side: (4, >= count)."""
    for k in range(count):
        for axis in range(3):
            spheres[axis, k] = polygons.middles[pool[first + k], axis]
        spheres[3, k] = polygons.radii[pool[first + k]]


@kernel
def _near_plane(
    spheres: FloatArray, count: int, x: FloatArray, normal: FloatArray, apart: FloatArray
) -> None:
    """How far each sphere reaches through the plane at x (3,) with that normal, m, into apart (>= count)."""
    a = normal[0]
    b = normal[1]
    c = normal[2]
    d = a * x[0] + b * x[1] + c * x[2]
    for k in range(count):
        apart[k] = spheres[3, k] - abs(a * spheres[0, k] + b * spheres[1, k] + c * spheres[2, k] - d)


@kernel
def free_parts(
    polygons: Polygons,
    outlines: Outlines,
    wedge: FloatArray,
    normal: FloatArray,
    is_ev: bool,
    skip: int,
    receiver: int,
    source: int,
    pool: IntArray,
    first: int,
    count: int,
    spheres: FloatArray,
    tolerance: float,
    apart: FloatArray,
    hidden: FloatArray,
    parts: FloatArray,
) -> int:
    """The parts of a wedge's base that the blockers pool[first : first + count] leave free.

    wedge (3, 3): apex and the base's ends, world metres; normal (3,) unit; skip: the edge (VE) or vertex
    (EV) that casts the shadow, whose own sheets hide nothing; spheres: as `gather_spheres` lays them out;
    apart (>= count) and hidden (>= 2 count, 2) are scratch. Intervals within [0, 1] are written to parts
    (>= 2 count + 1, 2), ascending; returns their number.
    """
    intervals = 0
    _near_plane(spheres, count, wedge[0], normal, apart)
    for entry in range(count):
        # Only polygons on both sides of the wedge's plane cut it.
        if apart[entry] <= 0.0:
            continue
        c = pool[first + entry]
        n = polygons.counts[c]
        low = 0.0
        high = 0.0
        for k in range(n):
            h = _over(polygons, c, k, wedge, normal)
            low = min(low, h)
            high = max(high, h)
        if low >= -tolerance or high <= tolerance:
            continue
        own = False
        for k in range(n):
            if (is_ev and outlines.vertex[c, k] == skip) or (not is_ev and outlines.edge[c, k] == skip):
                own = True
        if own:
            continue
        if is_ev and _holds(polygons, c, wedge[0], tolerance):
            return 0
        before = intervals
        intervals = _hide(polygons, c, wedge, normal, is_ev, receiver, source, tolerance, hidden, intervals)
        for i in range(before, intervals):
            if hidden[i, 0] <= 0.0 and hidden[i, 1] >= 1.0:
                return 0
    return _complement(hidden, intervals, parts)
