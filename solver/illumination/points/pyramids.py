"""What a convex blocker hides from a point: the inside of a pyramid, beyond the blocker's plane ([H 6.2]).

Places are taken from the point, so that the pyramid's sides have no offset: a place is hidden if it is above
all sides, and beyond the plane.

Small kernels are inlined, and take whole arrays and the row that is meant. numba counts references to arrays
where a kernel is called that may fail, and to views of rows: that took more than half of the time.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from solver.geometry.obstacles import is_needless
from solver.kernels import inline_kernel, kernel
from solver.types import Corners, Float32Array, FloatArray, Int64Array, IntArray

AXIS: Final = 0
SINE: Final = 3
COSINE: Final = 4
DISTANCE: Final = 5
NORMAL: Final = 6
SIDES: Final = 9
PYRAMID: Final = 21
"""Columns of a pyramid's row: a cone around it, by unit axis, sine and cosine of half its angle; distance of
the plane in metres, 0 where the point is on it and nothing is hidden; the plane's unit normal away from the
point; unit normals of four sides, inside above."""

CLEAR: Final = -1
PLANE: Final = 16
"""What a pyramid does to a polygon: nothing; cut it by its plane."""

HIDDEN: Final = -1
"""In place of a number of blockers: one of them hides all there is."""

_ROUNDING: Final = 1e-15
"""By how much more than they must the cosine of two axes has to differ for their cones to be apart."""

NEARLY: Final = np.float32(4e-6)
"""As much for cones in few digits."""

_WIDEST: Final = np.float32(0.99999)
"""A cone's sine in few digits, at most; wider ones are asked in full."""

_ALL_AROUND: Final = np.float32(1e6)

SLIVER: Final = 1e-14
"""What reaches past a side by less than this angle does not: so much may rounding make of an edge that two
blockers, or blocker and source, have in common."""


@inline_kernel
def _cone_around(x: float, y: float, z: float, radius: float) -> tuple[float, float, float, float, float]:
    """Unit axis, sine and cosine of half the angle of the cone around a sphere; the sine is 1 within it."""
    away = math.sqrt(x * x + y * y + z * z)
    scale = 1.0 / away if away > 0.0 else 0.0
    sine = radius * scale if radius < away else 1.0
    return x * scale, y * scale, z * scale, sine, math.sqrt(1.0 - sine * sine)


@inline_kernel
def raise_pyramid(
    x: FloatArray,
    corners: Corners,
    polygon: int,
    count: int,
    normals: FloatArray,
    plane: int,
    tolerance: float,
    pyramids: FloatArray,
    row: int,
) -> None:
    """Fill a row of pyramids (p, PYRAMID) with what a polygon hides from a point x (3,).

    The polygon is a row of corners (b, 4, 3), its unit normal the row `plane` of normals (n, 3). A point
    within `tolerance` metres of its plane is on it.
    """
    distance = 0.0
    for axis in range(3):
        distance += normals[plane, axis] * (corners[polygon, 0, axis] - x[axis])
    sign = 1.0 if distance > 0.0 else -1.0
    for axis in range(3):
        pyramids[row, NORMAL + axis] = sign * normals[plane, axis]
    pyramids[row, DISTANCE] = abs(distance) if abs(distance) > tolerance else 0.0
    cx = cy = cz = 0.0
    for k in range(count):
        cx += (corners[polygon, k, 0] - x[0]) / count
        cy += (corners[polygon, k, 1] - x[1]) / count
        cz += (corners[polygon, k, 2] - x[2]) / count
    square = 0.0
    for k in range(count):
        dx = corners[polygon, k, 0] - x[0] - cx
        dy = corners[polygon, k, 1] - x[1] - cy
        dz = corners[polygon, k, 2] - x[2] - cz
        here = dx * dx + dy * dy + dz * dz
        square = here if here > square else square
    ax, ay, az, sine, cosine = _cone_around(cx, cy, cz, math.sqrt(square))
    pyramids[row, AXIS] = ax
    pyramids[row, AXIS + 1] = ay
    pyramids[row, AXIS + 2] = az
    pyramids[row, SINE] = sine
    pyramids[row, COSINE] = cosine
    last = count - 1
    for k in range(count):
        ax = corners[polygon, last, 0] - x[0]
        ay = corners[polygon, last, 1] - x[1]
        az = corners[polygon, last, 2] - x[2]
        # Not from corner to corner: the cross product would lose the digits of what is small or far away.
        ex = corners[polygon, k, 0] - corners[polygon, last, 0]
        ey = corners[polygon, k, 1] - corners[polygon, last, 1]
        ez = corners[polygon, k, 2] - corners[polygon, last, 2]
        sx = ay * ez - az * ey
        sy = az * ex - ax * ez
        sz = ax * ey - ay * ex
        length = math.sqrt(sx * sx + sy * sy + sz * sz)
        scale = sign / length if length > 0.0 else 0.0
        # An edge without length cuts nothing: all that is beyond the plane is above it.
        instead = 0.0 if length > 0.0 else 1.0
        pyramids[row, SIDES + 3 * k] = scale * sx + instead * pyramids[row, NORMAL]
        pyramids[row, SIDES + 3 * k + 1] = scale * sy + instead * pyramids[row, NORMAL + 1]
        pyramids[row, SIDES + 3 * k + 2] = scale * sz + instead * pyramids[row, NORMAL + 2]
        last = k


@inline_kernel
def cone_of(polygons: FloatArray, slot: int, count: int) -> tuple[float, float, float, float, float, float]:
    """A cone around a row of polygons (s, n, 3): axis, sine and cosine of half its angle; and its sliver.

    The cone is that of a sphere around the middle of the corners. The sliver: by so many metres the polygon
    may reach past a side and does not.
    """
    cx = cy = cz = 0.0
    for k in range(count):
        cx += polygons[slot, k, 0]
        cy += polygons[slot, k, 1]
        cz += polygons[slot, k, 2]
    cx /= count
    cy /= count
    cz /= count
    square = 0.0
    for k in range(count):
        dx = polygons[slot, k, 0] - cx
        dy = polygons[slot, k, 1] - cy
        dz = polygons[slot, k, 2] - cz
        here = dx * dx + dy * dy + dz * dz
        square = here if here > square else square
    radius = math.sqrt(square)
    ax, ay, az, sine, cosine = _cone_around(cx, cy, cz, radius)
    return ax, ay, az, sine, cosine, SLIVER * (radius + math.sqrt(cx * cx + cy * cy + cz * cz))


@inline_kernel
def cones_part(
    x: float, y: float, z: float, sine: float, cosine: float, pyramids: FloatArray, row: int
) -> bool:
    """Whether a cone and the one around a pyramid have only the point in common."""
    other = pyramids[row, SINE]
    along = x * pyramids[row, AXIS] + y * pyramids[row, AXIS + 1] + z * pyramids[row, AXIS + 2]
    limit = cosine * pyramids[row, COSINE] - sine * other - _ROUNDING
    return bool(along < limit and sine < 1.0 and other < 1.0)


@inline_kernel
def sides_cut(
    polygons: FloatArray,
    slot: int,
    count: int,
    pyramids: FloatArray,
    row: int,
    sides: int,
    tolerance: float,
    sliver: float,
) -> int:
    """By which planes of a pyramid a row of polygons (s, n, 3) relative to the point is cut: a bit for each.

    Bits 0 to 3 are the sides, PLANE the blocker's own. 0 if all of the polygon is hidden, CLEAR if all of it
    is before the blocker or outside one side. `tolerance` is that of the plane, `sliver` that of the sides.
    """
    cut = 0 if pyramids[row, DISTANCE] > 0.0 else CLEAR
    side = -1
    while side < sides and cut != CLEAR:
        at = NORMAL if side < 0 else SIDES + 3 * side
        offset = pyramids[row, DISTANCE] if side < 0 else 0.0
        margin = tolerance if side < 0 else sliver
        a = pyramids[row, at]
        b = pyramids[row, at + 1]
        c = pyramids[row, at + 2]
        low = math.inf
        high = -math.inf
        for k in range(count):
            height = a * polygons[slot, k, 0] + b * polygons[slot, k, 1] + c * polygons[slot, k, 2]
            low = height if height < low else low
            high = height if height > high else high
        if high - offset <= margin:
            cut = CLEAR
        elif low - offset < -margin:
            cut |= PLANE if side < 0 else 1 << side
        side += 1
    return cut


class Sight(NamedTuple):
    """What polygons may stand between, and how one point sees them; raised where they are first asked for."""

    corners: Corners
    """(b, 4, 3)"""
    sides: IntArray
    """(b,) 3 or 4"""
    normals: FloatArray
    """(b, 3)"""
    pyramids: FloatArray
    """(b, PYRAMID)"""
    cones: Float32Array
    """(b, 5) their cones alone: axis, sine and cosine of half the angle, so that all fit the nearest cache"""
    spheres: FloatArray
    """(b, 4) around them: middle and radius, metres"""
    seen: Int64Array
    """(b,) for which point there is a cone"""
    raised: Int64Array
    """(b,) for which point there is a pyramid"""
    solid: IntArray
    """(b,) what they are, as `Obstacles` has it"""
    bounds: FloatArray
    """(s, BOUNDS) of the solids"""


@kernel
def make_sight(
    corners: Corners, sides: IntArray, normals: FloatArray, solid: IntArray, bounds: FloatArray
) -> Sight:
    """Of polygons that no point has seen."""
    b = len(normals)
    spheres = np.zeros((b, 4))
    for polygon in range(b):
        for axis in range(3):
            for k in range(sides[polygon]):
                spheres[polygon, axis] += corners[polygon, k, axis] / sides[polygon]
        for k in range(sides[polygon]):
            square = 0.0
            for axis in range(3):
                square += (corners[polygon, k, axis] - spheres[polygon, axis]) ** 2
            spheres[polygon, 3] = max(spheres[polygon, 3], math.sqrt(square))
    return Sight(
        corners,
        sides,
        normals,
        np.empty((b, PYRAMID)),
        np.empty((b, 5), dtype=np.float32),
        spheres,
        np.full(b, -1, dtype=np.int64),
        np.full(b, -1, dtype=np.int64),
        solid,
        bounds,
    )


@inline_kernel
def _stands_aside(
    x: FloatArray,
    normal: FloatArray,
    corners: Corners,
    polygon: int,
    count: int,
    sources: FloatArray,
    source: int,
    sides: int,
) -> bool:
    """Whether a polygon is below the horizon, beyond a source, or outside one side of what is before it."""
    aside = False
    for side in range(-2, sides):
        at = NORMAL if side < 0 else SIDES + 3 * side
        all_out = not aside
        for k in range(count if all_out else 0):
            dx = corners[polygon, k, 0] - x[0]
            dy = corners[polygon, k, 1] - x[1]
            dz = corners[polygon, k, 2] - x[2]
            over_horizon = normal[0] * dx + normal[1] * dy + normal[2] * dz
            height = sources[source, at] * dx + sources[source, at + 1] * dy + sources[source, at + 2] * dz
            if side == -2:
                out = over_horizon <= 0.0
            elif side == -1:
                out = height >= sources[source, DISTANCE]
            else:
                out = height <= 0.0
            all_out = all_out and out
        aside = aside or all_out
    return aside


@inline_kernel
def look_at(
    x: FloatArray,
    polygon: int,
    corners: Corners,
    normals: FloatArray,
    spheres: FloatArray,
    solid: IntArray,
    bounds: FloatArray,
    tolerance: float,
    cones: Float32Array,
) -> bool:
    """A polygon's cone in few digits, from a point (3,); True if it hides nothing that others do not.

    From within the cone, it is one that nothing is aside of; of what hides nothing, one that all is aside of.
    """
    distance = 0.0
    for axis in range(3):
        distance += normals[polygon, axis] * (corners[polygon, 0, axis] - x[axis])
    needless = abs(distance) <= tolerance
    needless = needless or is_needless(x, distance > 0.0, solid[polygon], bounds, tolerance)
    cx = spheres[polygon, 0] - x[0]
    cy = spheres[polygon, 1] - x[1]
    cz = spheres[polygon, 2] - x[2]
    ax, ay, az, sine, cosine = _cone_around(cx, cy, cz, spheres[polygon, 3])
    cones[polygon, 0] = ax
    cones[polygon, 1] = ay
    cones[polygon, 2] = az
    cones[polygon, 3] = 0.0 if needless else sine
    cones[polygon, 4] = cosine
    if needless:
        cones[polygon, 4] = _ALL_AROUND
    elif sine >= _WIDEST:
        cones[polygon, 4] = -_ALL_AROUND
    return needless


@kernel
def cull(
    x: FloatArray,
    point: int,
    normal: FloatArray,
    polygons: FloatArray,
    slot: int,
    count: int,
    sources: FloatArray,
    source: int,
    source_sides: int,
    blockers: IntArray,
    first: int,
    stop: int,
    corners: Corners,
    sides: IntArray,
    normals: FloatArray,
    pyramids: FloatArray,
    cones: Float32Array,
    spheres: FloatArray,
    seen: Int64Array,
    raised: Int64Array,
    solid: IntArray,
    bounds: FloatArray,
    tolerance: float,
    out: IntArray,
    used: int,
) -> int:
    """Which of blockers[first : stop] may hide some of a source from a point x (3,), to out[used:].

    The source's part above the horizon is a row of polygons (s, n, 3), relative to x; its own pyramid is a
    row of sources (p, PYRAMID). corners ... bounds are those of a `Sight`; `point` is the number of x, what
    is raised for another is raised anew. Returns how many there are, or HIDDEN.
    """
    ax, ay, az, sine, cosine, sliver = cone_of(polygons, slot, count)
    nearly_x, nearly_y, nearly_z = np.float32(ax), np.float32(ay), np.float32(az)
    nearly_sine, nearly_cosine = np.float32(sine), np.float32(cosine)
    kept = 0
    for b in range(first, stop):
        blocker = blockers[b]
        if seen[blocker] != point:
            if look_at(x, blocker, corners, normals, spheres, solid, bounds, tolerance, cones):
                pyramids[blocker, DISTANCE] = 0.0
                raised[blocker] = point
            seen[blocker] = point
        # Most are aside, and few digits tell.
        limit = nearly_cosine * cones[blocker, 4] - nearly_sine * cones[blocker, 3] - NEARLY
        along = nearly_x * cones[blocker, 0] + nearly_y * cones[blocker, 1] + nearly_z * cones[blocker, 2]
        if along < limit and nearly_sine < _WIDEST:
            continue
        if raised[blocker] != point:
            raise_pyramid(x, corners, blocker, sides[blocker], normals, blocker, tolerance, pyramids, blocker)
            raised[blocker] = point
        cut = CLEAR
        if not cones_part(ax, ay, az, sine, cosine, pyramids, blocker):
            cut = sides_cut(polygons, slot, count, pyramids, blocker, sides[blocker], tolerance, sliver)
        if cut == 0:
            kept = HIDDEN
            break
        if cut != CLEAR and not _stands_aside(
            x, normal, corners, blocker, sides[blocker], sources, source, source_sides
        ):
            out[used + kept] = blocker
            kept += 1
    return kept
