"""VE and EV discontinuities: the shadows that blockers' edges cast from a source's vertices, and their
vertices from its edges ([H 5.2, 5.5.3]).

A pair of source and receiver brings the patches that can stand between them. Their welded edges and
vertices are taken once each, however many patches share them. Triple-edge events are left out, as in
[H 5.2], and so are those of two blockers, but for what `graze_segments` finds.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.illumination.discontinuity.outlines import Outlines
from solver.illumination.discontinuity.segments import (
    EV,
    SAMPLES,
    VE,
    Polygons,
    counts_as_segment,
    patch_diameter,
    receiver_planes,
    write_segment,
)
from solver.illumination.discontinuity.shadow_sight import free_parts, gather_spheres
from solver.illumination.discontinuity.shadow_strength import wedge_strength
from solver.illumination.discontinuity.silhouettes import is_silhouette, silhouette_rays, silhouette_spans
from solver.illumination.discontinuity.wedges import (
    HEIGHTS,
    know_heights,
    meet_receiver,
    shadow_of_edge,
    shadow_of_vertex,
    wedge_normal,
)
from solver.kernels import kernel
from solver.types import FloatArray, IntArray

_NARROWEST: Final = 1e-9
"""Spans of a source's edge below this part of it are none."""


@kernel
def _write_parts(
    polygons: Polygons,
    outlines: Outlines,
    r: int,
    s: int,
    blocker: int,
    is_ev: bool,
    cast_by: int,
    wedge: FloatArray,
    planes: FloatArray,
    sides: int,
    size: float,
    rays: FloatArray,
    ray_count: int,
    cuts: FloatArray,
    cut_count: int,
    reach: float,
    pool: IntArray,
    first: int,
    count: int,
    spheres: FloatArray,
    tolerance: float,
    keep_hidden: bool,
    apart: FloatArray,
    hidden: FloatArray,
    parts: FloatArray,
    rows: FloatArray,
    ids: IntArray,
    used: int,
) -> int:
    """Write the free parts of a wedge (3, 3) of apex and base, with their strengths, as rows from `used` on.

    Returns how many rows are used then, or -1 if they are full.
    """
    segment = np.empty((2, 3))
    o = polygons.corners[r, 0]
    for end in range(2):
        meet_receiver(wedge, float(end), planes, o, is_ev, segment[end])
    if not counts_as_segment(planes, sides, segment, size):
        return used
    normal = np.empty(3)
    if not wedge_normal(wedge, normal):
        return used
    free = 1
    parts[0, 0] = 0.0
    parts[0, 1] = 1.0
    if not keep_hidden:
        free = free_parts(
            polygons, outlines, wedge, normal, is_ev, cast_by, r, s, pool, first, count, spheres, tolerance,
            apart, hidden, parts,
        )  # fmt: skip
    scratch = np.empty((8, 3))
    x, b, source_point = np.empty((3, 3))
    for part in range(free):
        u0 = parts[part, 0]
        u1 = parts[part, 1]
        w0 = meet_receiver(wedge, u0, planes, o, is_ev, segment[0])
        w1 = meet_receiver(wedge, u1, planes, o, is_ev, segment[1])
        if not counts_as_segment(planes, sides, segment, size):
            continue
        if used == len(rows):
            return -1
        write_segment(polygons, r, s, blocker, EV if is_ev else VE, segment, used, rows, ids)
        rows[used, 6] = 0.0
        for sample in range(SAMPLES):
            # The middle of the segment is not that of the base: the base is seen in perspective.
            u = u0 if sample == 0 else u1
            if sample == 1:
                u = u0 + (u1 - u0) * w0 / (w0 + w1)
            meet_receiver(wedge, u, planes, o, is_ev, x)
            for axis in range(3):
                x[axis] += o[axis]
                base = wedge[1, axis] + u * (wedge[2, axis] - wedge[1, axis])
                b[axis] = wedge[0, axis] if is_ev else base
                source_point[axis] = base if is_ev else wedge[0, axis]
            ratio, factor, width, bend = wedge_strength(
                polygons, r, s, x, b, source_point, normal, rays, ray_count, cuts, cut_count, reach,
                tolerance, scratch,
            )  # fmt: skip
            if sample != 1:
                rows[used, 6] = max(rows[used, 6], ratio)
            rows[used, 7 + sample] = factor
            rows[used, 7 + SAMPLES + sample] = width
            rows[used, 7 + 2 * SAMPLES + sample] = bend
        used += 1
    return used


@kernel
def cast_shadows(
    polygons: Polygons,
    outlines: Outlines,
    receivers: IntArray,
    sources: IntArray,
    blocker_count: IntArray,
    pool: IntArray,
    tolerance: float,
    keep_hidden: bool,
    begin: int,
    first: int,
    rows: FloatArray,
    ids: IntArray,
) -> tuple[int, int, int]:
    """Write the VE and EV discontinuities of the pairs from `begin` on to rows (m, FIELDS), ids (m, 4).

    pool holds the pairs' blockers one after the other, those of pair `begin` from `first` on; `tolerance`
    in metres. Returns (rows written, the pair where the rows were full, its place in the pool).
    """
    most = 0
    for pair in range(begin, len(receivers)):
        most = max(most, blocker_count[pair])
    slot = np.full(len(outlines.point), -1, dtype=np.int32)
    taken = np.full(len(outlines.ends), -1, dtype=np.int32)
    vertex, edge, by = np.empty((3, 4 * most), dtype=np.int32)
    met = np.empty(4 * most, dtype=np.int32)
    known = np.empty((4 * most, HEIGHTS))
    planes = np.empty((5, 4))
    hidden, parts = np.empty((2 * most, 2)), np.empty((2 * most + 1, 2))
    spheres, apart = np.empty((4, most)), np.empty(most)
    wedge = np.empty((3, 3))
    rays, cuts = np.empty((2, max(2, outlines.widest_fan), 3))
    spans = np.empty(outlines.widest_fan + 2)
    s0, s1 = np.empty((2, HEIGHTS))
    used = 0
    for pair in range(begin, len(receivers)):
        r = receivers[pair]
        s = sources[pair]
        count = blocker_count[pair]
        if count == 0:
            continue
        before = used
        # The blockers' vertices and edges, once each.
        sides = receiver_planes(polygons, r, planes)
        size = patch_diameter(polygons, r)
        vertices = 0
        edges = 0
        gather_spheres(polygons, pool, first, count, spheres)
        for entry in range(first, first + count):
            c = pool[entry]
            for k in range(polygons.counts[c]):
                v = outlines.vertex[c, k]
                if slot[v] < 0 or slot[v] >= vertices or vertex[slot[v]] != v:
                    slot[v] = vertices
                    vertex[vertices] = v
                    met[vertices] = c
                    know_heights(polygons, r, s, planes, sides, outlines.point[v], known[vertices])
                    vertices += 1
                e = outlines.edge[c, k]
                if e >= 0 and taken[e] != pair:
                    taken[e] = pair
                    if not outlines.is_flat[e]:
                        edge[edges] = e
                        by[edges] = c
                        edges += 1
        n = polygons.counts[s]
        for k in range(n):
            following = (k + 1) % n
            know_heights(polygons, r, s, planes, sides, polygons.corners[s, k], s0)
            know_heights(polygons, r, s, planes, sides, polygons.corners[s, following], s1)
            # VE: the source's corner k, all edges.
            if outlines.is_corner[s, k] and s0[0] > tolerance:
                v = polygons.corners[s, k]
                before_k = (k + n - 1) % n
                for axis in range(3):
                    wedge[0, axis] = v[axis]
                    rays[0, axis] = polygons.corners[s, before_k, axis] - v[axis]
                    rays[1, axis] = polygons.corners[s, following, axis] - v[axis]
                for i in range(edges):
                    e = edge[i]
                    a = outlines.ends[e, 0]
                    b = outlines.ends[e, 1]
                    t0, t1 = shadow_of_edge(s0, known[slot[a]], known[slot[b]], sides, tolerance)
                    if t0 >= t1 or not is_silhouette(outlines, e, v[0], v[1], v[2], tolerance):
                        continue
                    for axis in range(3):
                        cuts[0, axis] = outlines.point[b, axis] - outlines.point[a, axis]
                        wedge[1, axis] = outlines.point[a, axis] + t0 * cuts[0, axis]
                        wedge[2, axis] = outlines.point[a, axis] + t1 * cuts[0, axis]
                    used = _write_parts(
                        polygons, outlines, r, s, by[i], False, e, wedge, planes, sides, size, rays, 2, cuts,
                        1, math.inf, pool, first, count, spheres, tolerance, keep_hidden, apart, hidden,
                        parts, rows, ids, used,
                    )  # fmt: skip
                    if used < 0:
                        return before, pair, first
            # EV: the source's edge from corner k, all vertices.
            e = outlines.edge[s, k]
            if e < 0 or outlines.is_inner[e] or max(s0[0], s1[0]) <= tolerance:
                continue
            length = 0.0
            for axis in range(3):
                length += (polygons.corners[s, following, axis] - polygons.corners[s, k, axis]) ** 2
            length = math.sqrt(length)
            for i in range(vertices):
                t0, t1 = shadow_of_vertex(s0, s1, known[i], sides, tolerance)
                if t0 >= t1:
                    continue
                w = vertex[i]
                a3 = polygons.corners[s, k]
                b3 = polygons.corners[s, following]
                cut_count = silhouette_spans(outlines, w, a3, b3, t0, t1, tolerance, spans)
                for j in range(cut_count - 1):
                    if spans[j + 1] - spans[j] <= _NARROWEST:
                        continue
                    middle = 0.5 * (spans[j] + spans[j + 1])
                    for axis in range(3):
                        step = b3[axis] - a3[axis]
                        wedge[0, axis] = outlines.point[w, axis]
                        wedge[1, axis] = a3[axis] + spans[j] * step
                        wedge[2, axis] = a3[axis] + spans[j + 1] * step
                        cuts[0, axis] = a3[axis] + middle * step
                    m = silhouette_rays(outlines, w, cuts[0], tolerance, rays)
                    if m == 0:
                        continue
                    used = _write_parts(
                        polygons, outlines, r, s, met[i], True, w, wedge, planes, sides, size, rays, m, rays,
                        m, length, pool, first, count, spheres, tolerance, keep_hidden, apart, hidden,
                        parts, rows, ids, used,
                    )  # fmt: skip
                    if used < 0:
                        return before, pair, first
        first += count
    return used, len(receivers), first
