"""What points on surfaces receive: lamps whole, reflected light over the links of their leaves ([H 6.2])."""

from __future__ import annotations

from typing import NamedTuple

from solver.illumination.points.cuts import ABOVE, WHOLE, clip_above
from solver.illumination.points.desk import (
    Desk,
    Elements,
    Light,
    height_before,
    lay,
    make_desk,
    relative_polygon,
)
from solver.illumination.points.factor_lanes import LANES
from solver.illumination.points.pyramids import HIDDEN, Sight, cull, make_sight, raise_pyramid
from solver.illumination.points.source_light import add_waiting
from solver.illumination.points.visible_parts import clip_by_pyramids, factor_of
from solver.kernels import kernel
from solver.types import FloatArray, Int64Array, IntArray, Points
from solver.visibility.shafts import NONE


class Table(NamedTuple):
    """Sources of elements with what may be in between, by rows."""

    first: Int64Array
    """(n + 1,) where the sources of each of n elements begin"""
    source: IntArray
    """an element"""
    row: IntArray
    """row of the columns below"""
    kind: IntArray
    """visibility class"""
    visibility: FloatArray
    """fraction"""
    blocker_start: Int64Array
    blocker_count: IntArray
    pool: IntArray


@kernel
def gather_over_links(
    positions: Points,
    normals: FloatArray,
    leaves: IntArray,
    expected: FloatArray,
    accuracy: float,
    parent: IntArray,
    links: Table,
    lamps: Table,
    emission: FloatArray,
    elements: Elements,
    light: Light,
    most_blockers: int,
    tolerance: float,
    start: int,
    stop: int,
    out: FloatArray,
) -> None:
    """Irradiance out (n, channels) at points [start, stop) that lie on leaf elements (n,).

    `expected` (n,) luminance irradiance scales `accuracy`: the share of it that an element's residual may
    bring, and the RMS error of all that count with the visibility of their links. A lamp is a patch that
    emits, whole; links are those of the leaf and its ancestors, `light` without emission. A point within
    `tolerance` metres of a plane sees what is there edge-on.
    """
    patches = len(elements.normals)
    desk = make_desk(most_blockers)
    sight = make_sight(
        elements.corners[:patches], elements.corner_count[:patches], elements.normals, elements.solid,
        elements.bounds,
    )  # fmt: skip
    for i in range(start, stop):
        x = positions[i]
        normal = normals[i]
        e = leaves[i]
        for c in range(out.shape[1]):
            out[i, c] = 0.0
        for k in range(lamps.first[e], lamps.first[e + 1]):
            factor = _lamp_factor(x, i, normal, lamps, k, elements, sight, tolerance, desk)
            for c in range(out.shape[1]):
                out[i, c] += factor * emission[lamps.source[k], c]
        share = accuracy * expected[i]
        allowance = share * share
        waiting = 0
        while e >= 0:
            for k in range(links.first[e], links.first[e + 1]):
                row = links.row[k]
                source = links.source[k]
                if links.kind[row] == NONE or light.luminance[source] <= 0.0:
                    continue
                p = elements.patch[source]
                if height_before(x, elements.corners, source, elements.normals, p) <= tolerance:
                    continue
                blockers = links.blocker_count[row]
                begin = links.blocker_start[row]
                lay(
                    desk.waiting,
                    desk.polygon,
                    desk.visibility,
                    waiting,
                    x,
                    elements.corners,
                    source,
                    -1 - begin,
                    blockers,
                    links.visibility[row],
                )
                waiting += 1
                if waiting == LANES:
                    allowance = add_waiting(
                        x, i, normal, desk, waiting, 0, links.pool, share, allowance, elements, light, sight,
                        tolerance, out,
                    )  # fmt: skip
                    waiting = 0
            e = parent[e]
        if waiting > 0:
            add_waiting(
                x, i, normal, desk, waiting, 0, links.pool, share, allowance, elements, light, sight,
                tolerance, out,
            )  # fmt: skip


@kernel
def _lamp_factor(
    x: FloatArray,
    point: int,
    normal: FloatArray,
    lamps: Table,
    k: int,
    elements: Elements,
    sight: Sight,
    tolerance: float,
    desk: Desk,
) -> float:
    """Form factor to the visible part of a lamp."""
    s = lamps.source[k]
    row = lamps.row[k]
    corners = elements.corners
    normals = elements.normals
    sides = elements.corner_count[s]
    buffers = desk.buffers
    factor = 0.0
    if lamps.kind[row] != NONE and height_before(x, corners, s, normals, s) > tolerance:
        relative_polygon(x, corners, s, sides, buffers.work, WHOLE)
        count = clip_above(buffers.work, buffers.stack, sides, normal)
        first = lamps.blocker_start[row]
        raise_pyramid(x, corners, s, sides, normals, s, 0.0, desk.pyramid, 0)
        kept = 0
        if count > 0:
            kept = cull(
                x, point, normal, buffers.work, ABOVE, count, desk.pyramid, 0, sides, lamps.pool, first,
                first + lamps.blocker_count[row], sight.corners, sight.sides, sight.normals, sight.pyramids,
                sight.cones, sight.spheres, sight.seen, sight.raised, sight.solid, sight.bounds, tolerance,
                desk.pool, 0,
            )  # fmt: skip
        if kept == 0:
            factor = factor_of(buffers.work, ABOVE, count, normal)
        elif kept != HIDDEN:
            factor, _ = clip_by_pyramids(
                normal, count, desk.pool, 0, kept, sight.pyramids, sight.sides, tolerance, buffers.stack,
                buffers.corners, buffers.blocker, buffers.work, desk.parts, desk.part_count,
            )  # fmt: skip
    return max(0.0, factor)
