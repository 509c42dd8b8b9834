"""Kernels of point irradiance: one source element with its blockers, and all that a point gathers from.

A source is entered as far as its radiosity residual, times the point's form factor, is felt. What is left
counts with the radiosity where the light that arrives from it comes from on average. Visible parts are exact, but for what
brings less than a share `weak` of the irradiance, which counts with the visibility of its link.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.illumination.visible_parts import PER_BLOCKER, ROOM, visible_factor
from solver.kernels import inline_kernel, kernel
from solver.transport.lambert import point_form_factor
from solver.types import Corners, FloatArray, Int64Array, IntArray, Points
from solver.visibility.bvh import walk_hierarchy
from solver.visibility.shafts import NONE

_DEPTH: Final = 512
"""Elements waiting to be looked at; where there are more, they are not entered."""

_PARTS: Final = 64
"""Visible pieces whose place is looked at; those that are more count as much as these do."""

_INWARDS: Final = 1.0 / math.sqrt(3.0)
"""Where between middle and corner the points lie that stand for a polygon: exact for quadratics."""

_NEAR: Final = 1.0
"""Within this times its diagonal the points that stand for an element tell too little of a gradient on it."""

_MISSED: Final = 0.2
"""Part of the linear variation of an element's radiosity that they then miss."""


@inline_kernel
def _weigh(
    x: FloatArray,
    normal: FloatArray,
    source_normal: FloatArray,
    polygon: FloatArray,
    count: int,
    relative: bool,
    sums: FloatArray,
) -> None:
    """Add to sums (4,) the weight, and the weighted place relative to x, of points of a convex polygon.

    The points lie between its middle and its corners, and weigh as much as the light from there would count.
    """
    cx = cy = cz = 0.0
    for k in range(count):
        cx += polygon[k, 0] / count
        cy += polygon[k, 1] / count
        cz += polygon[k, 2] / count
    ax = ay = az = 0.0
    for k in range(1, count - 1):
        ux = polygon[k, 0] - polygon[0, 0]
        uy = polygon[k, 1] - polygon[0, 1]
        uz = polygon[k, 2] - polygon[0, 2]
        vx = polygon[k + 1, 0] - polygon[0, 0]
        vy = polygon[k + 1, 1] - polygon[0, 1]
        vz = polygon[k + 1, 2] - polygon[0, 2]
        ax += uy * vz - uz * vy
        ay += uz * vx - ux * vz
        az += ux * vy - uy * vx
    area = math.sqrt(ax * ax + ay * ay + az * az) / count
    if not relative:
        cx -= x[0]
        cy -= x[1]
        cz -= x[2]
    for k in range(count):
        px = polygon[k, 0] if relative else polygon[k, 0] - x[0]
        py = polygon[k, 1] if relative else polygon[k, 1] - x[1]
        pz = polygon[k, 2] if relative else polygon[k, 2] - x[2]
        px = cx + _INWARDS * (px - cx)
        py = cy + _INWARDS * (py - cy)
        pz = cz + _INWARDS * (pz - cz)
        cosine = normal[0] * px + normal[1] * py + normal[2] * pz
        other = -(source_normal[0] * px + source_normal[1] * py + source_normal[2] * pz)
        square = px * px + py * py + pz * pz
        if cosine > 0.0 and other > 0.0:
            weight = area * cosine * other / (square * square)
            sums[0] += weight
            sums[1] += weight * px
            sums[2] += weight * py
            sums[3] += weight * pz


@kernel
def _add_source(
    x: FloatArray,
    normal: FloatArray,
    root: int,
    blockers: IntArray,
    first: int,
    last: int,
    visibility: float,
    limit: float,
    weak: float,
    child: IntArray,
    child_count: IntArray,
    corners: Corners,
    counts: IntArray,
    patch: IntArray,
    centroid: Points,
    axes: FloatArray,
    patch_normals: FloatArray,
    functions: FloatArray,
    luminance: FloatArray,
    spread: FloatArray,
    slope: FloatArray,
    extent: FloatArray,
    patch_counts: IntArray,
    tolerance: float,
    stack: FloatArray,
    stack_count: IntArray,
    stack_next: IntArray,
    work: FloatArray,
    parts: FloatArray,
    part_count: IntArray,
    waiting: IntArray,
    scratch: FloatArray,
    place: FloatArray,
    out: FloatArray,
) -> None:
    """Add to out (channels,) the irradiance at x from the element `root` past blockers[first : last]."""
    waiting[0] = root
    top = 1
    while top > 0:
        top -= 1
        e = waiting[top]
        if luminance[e] <= 0.0:
            continue
        p = patch[e]
        height = 0.0
        for axis in range(3):
            height += patch_normals[p, axis] * (x[axis] - corners[e, 0, axis])
        if height <= 0.0:
            continue
        factor = point_form_factor(
            x[0], x[1], x[2], normal[0], normal[1], normal[2], corners[e], counts[e], scratch
        )
        if factor <= 0.0:
            continue
        square = 0.0
        for axis in range(3):
            square += (x[axis] - centroid[e, axis]) ** 2
        variation = spread[e]
        if square < _NEAR * extent[e]:
            variation += _MISSED * slope[e]
        if child[e] >= 0 and factor * variation > limit and top + child_count[e] <= _DEPTH:
            for k in range(child[e], child[e] + child_count[e]):
                waiting[top] = k
                top += 1
            continue
        place[:] = 0.0
        if last > first:
            if factor * luminance[e] <= weak:
                factor *= visibility
                _weigh(x, normal, patch_normals[p], corners[e], counts[e], False, place)
            else:
                factor, found = visible_factor(
                    x, normal, corners[e], counts[e], blockers, first, last, corners, patch_counts,
                    patch_normals, tolerance, stack, stack_count, stack_next, work, parts, part_count,
                )  # fmt: skip
                if factor <= 0.0:
                    continue
                for part in range(min(found, len(parts))):
                    _weigh(x, normal, patch_normals[p], parts[part], part_count[part], True, place)
        else:
            _weigh(x, normal, patch_normals[p], corners[e], counts[e], False, place)
        u = 0.0
        v = 0.0
        if place[0] > 0.0:
            for axis in range(3):
                from_centroid = place[1 + axis] / place[0] + x[axis] - centroid[e, axis]
                u += axes[p, 0, axis] * from_centroid
                v += axes[p, 1, axis] * from_centroid
        for c in range(len(out)):
            radiosity = functions[e, 0, c] + u * functions[e, 1, c] + v * functions[e, 2, c]
            out[c] += factor * max(0.0, radiosity)


@kernel
def gather_on_surfaces(
    positions: Points,
    normals: FloatArray,
    elements: IntArray,
    expected: FloatArray,
    accuracy: float,
    parent: IntArray,
    link_first: Int64Array,
    link: IntArray,
    link_other: IntArray,
    link_kind: IntArray,
    link_visibility: FloatArray,
    link_blocker_start: Int64Array,
    link_blocker_count: IntArray,
    link_pool: IntArray,
    lamp_first: Int64Array,
    lamp: IntArray,
    lamp_kind: IntArray,
    lamp_blocker_start: Int64Array,
    lamp_blocker_count: IntArray,
    lamp_pool: IntArray,
    emission: FloatArray,
    child: IntArray,
    child_count: IntArray,
    corners: Corners,
    counts: IntArray,
    patch: IntArray,
    centroid: Points,
    axes: FloatArray,
    patch_normals: FloatArray,
    functions: FloatArray,
    luminance: FloatArray,
    spread: FloatArray,
    slope: FloatArray,
    extent: FloatArray,
    most_blockers: int,
    tolerance: float,
    start: int,
    stop: int,
    out: FloatArray,
) -> None:
    """Irradiance out (n, channels) at points [start, stop) that lie on leaf elements (n,).

    `expected` (n,) luminance irradiance scales `accuracy`, the share that one source may err by. Rows of
    lamp_first are leaves' elements; a lamp is a patch that emits, whole. Reflected light comes over the links
    of the leaf and its ancestors, `functions` without emission.
    """
    stack = np.empty((2 + PER_BLOCKER * most_blockers, ROOM, 3))
    stack_count = np.empty(len(stack), dtype=np.int32)
    stack_next = np.empty(len(stack), dtype=np.int32)
    work = np.empty((5, ROOM, 3))
    parts = np.empty((_PARTS, ROOM, 3))
    part_count = np.empty(_PARTS, dtype=np.int32)
    no_parts = np.empty((0, ROOM, 3))
    waiting = np.empty(_DEPTH, dtype=np.int32)
    scratch = np.empty((8, 3))
    place = np.empty(4)
    for i in range(start, stop):
        x = positions[i]
        normal = normals[i]
        e = elements[i]
        for c in range(out.shape[1]):
            out[i, c] = 0.0
        for k in range(lamp_first[e], lamp_first[e + 1]):
            s = lamp[k]
            height = 0.0
            for axis in range(3):
                height += patch_normals[s, axis] * (x[axis] - corners[s, 0, axis])
            if lamp_kind[k] == NONE or height <= 0.0:
                continue
            first = lamp_blocker_start[k]
            factor, _ = visible_factor(
                x, normal, corners[s], counts[s], lamp_pool, first, first + lamp_blocker_count[k], corners,
                counts, patch_normals, tolerance, stack, stack_count, stack_next, work, no_parts, part_count,
            )  # fmt: skip
            for c in range(out.shape[1]):
                out[i, c] += factor * emission[s, c]
        share = accuracy * expected[i]
        while e >= 0:
            for k in range(link_first[e], link_first[e + 1]):
                n = link[k]
                if link_kind[n] == NONE:
                    continue
                first = link_blocker_start[n]
                _add_source(
                    x, normal, link_other[k], link_pool, first, first + link_blocker_count[n],
                    link_visibility[n], share, share, child, child_count, corners, counts, patch, centroid,
                    axes, patch_normals, functions, luminance, spread, slope, extent, counts, tolerance, stack, stack_count,
                    stack_next, work, parts, part_count, waiting, scratch, place, out[i],
                )  # fmt: skip
            e = parent[e]


@kernel
def _pyramid(
    x: FloatArray, normal: FloatArray, polygon: FloatArray, count: int, polygon_normal: FloatArray,
    planes: FloatArray,
) -> int:  # fmt: skip
    """Planes (6, 4) around the hull of a point and a polygon (4, 3) whose front it sees, as `shaft_planes`."""
    for axis in range(3):
        planes[0, axis] = polygon_normal[axis]
        planes[1, axis] = normal[axis]
    planes[0, 3] = (
        polygon_normal[0] * polygon[0, 0]
        + polygon_normal[1] * polygon[0, 1]
        + polygon_normal[2] * polygon[0, 2]
    )
    planes[1, 3] = normal[0] * x[0] + normal[1] * x[1] + normal[2] * x[2]
    found = 2
    for k in range(count):
        m = (k + 1) % count
        ax = polygon[k, 0] - x[0]
        ay = polygon[k, 1] - x[1]
        az = polygon[k, 2] - x[2]
        bx = polygon[m, 0] - x[0]
        by = polygon[m, 1] - x[1]
        bz = polygon[m, 2] - x[2]
        # The front is seen, so that the corners run counter-clockwise and the inside is on the right.
        sx = by * az - bz * ay
        sy = bz * ax - bx * az
        sz = bx * ay - by * ax
        length = math.sqrt(sx * sx + sy * sy + sz * sz)
        if length <= 0.0:
            continue
        planes[found, 0] = sx / length
        planes[found, 1] = sy / length
        planes[found, 2] = sz / length
        planes[found, 3] = (sx * x[0] + sy * x[1] + sz * x[2]) / length
        found += 1
    return found


@kernel
def gather_anywhere(
    positions: Points,
    normals: FloatArray,
    accuracy: float,
    low: FloatArray,
    high: FloatArray,
    skip: IntArray,
    leaf_first: IntArray,
    leaf_count: IntArray,
    order: IntArray,
    patches: int,
    child: IntArray,
    child_count: IntArray,
    corners: Corners,
    counts: IntArray,
    patch: IntArray,
    centroid: Points,
    axes: FloatArray,
    patch_normals: FloatArray,
    functions: FloatArray,
    luminance: FloatArray,
    spread: FloatArray,
    slope: FloatArray,
    extent: FloatArray,
    side_tolerance: float,
    tolerance: float,
    start: int,
    stop: int,
    out: FloatArray,
) -> None:
    """Irradiance out (n, channels) at points [start, stop) anywhere, from all patches; all is exact.

    `functions` are whole radiosities, emission included; the hierarchy (low ... order) is over the blockers.
    """
    stack = np.empty((2 + PER_BLOCKER * len(order), ROOM, 3))
    stack_count = np.empty(len(stack), dtype=np.int32)
    stack_next = np.empty(len(stack), dtype=np.int32)
    work = np.empty((5, ROOM, 3))
    parts = np.empty((_PARTS, ROOM, 3))
    part_count = np.empty(_PARTS, dtype=np.int32)
    waiting = np.empty(_DEPTH, dtype=np.int32)
    scratch = np.empty((8, 3))
    place = np.empty(4)
    planes = np.empty((6, 4))
    found = np.empty(len(order), dtype=np.int32)
    unoccluded = np.empty(patches)
    for i in range(start, stop):
        x = positions[i]
        normal = normals[i]
        total = 0.0
        for p in range(patches):
            unoccluded[p] = 0.0
            if luminance[p] > 0.0:
                unoccluded[p] = point_form_factor(
                    x[0], x[1], x[2], normal[0], normal[1], normal[2], corners[p], counts[p], scratch
                )
                total += unoccluded[p] * luminance[p]
        limit = accuracy * total
        for c in range(out.shape[1]):
            out[i, c] = 0.0
        for p in range(patches):
            if unoccluded[p] <= 0.0:
                continue
            sides = _pyramid(x, normal, corners[p], counts[p], patch_normals[p], planes)
            kept = walk_hierarchy(
                low, high, skip, leaf_first, leaf_count, order, planes, sides, side_tolerance, found
            )
            _add_source(
                x, normal, p, found, 0, kept, 1.0, limit, 0.0, child, child_count, corners, counts, patch,
                centroid, axes, patch_normals, functions, luminance, spread, slope, extent, counts, tolerance, stack,
                stack_count, stack_next, work, parts, part_count, waiting, scratch, place, out[i],
            )  # fmt: skip
