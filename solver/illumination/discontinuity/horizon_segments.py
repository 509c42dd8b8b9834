"""Horizon discontinuities: a source's plane splits a receiver, and what is behind sees nothing of it
([H 5.2, 5.5.3]).

In front of the line the form factor grows in proportion to the distance from it: a jump of the first
derivative. It has no blocker, and hardly a penumbra: its width is the distance over which the growth at
the line would bring the form factor that is found one size of the source further.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.illumination.discontinuity.contact_segments import cross_plane
from solver.illumination.discontinuity.segments import (
    HORIZON,
    SAMPLES,
    Polygons,
    counts_as_segment,
    patch_diameter,
    receiver_planes,
    write_segment,
)
from solver.kernels import kernel
from solver.transport.exchange import heights
from solver.transport.lambert import point_form_factor
from solver.types import FloatArray, IntArray
from solver.visibility.shafts import NONE

_NEAR: Final = 1e-4
"""How far from the line its slope is measured, in sizes of the source."""


@kernel
def find_horizons(
    polygons: Polygons,
    receivers: IntArray,
    sources: IntArray,
    visibility: IntArray,
    tolerance: float,
    rows: FloatArray,
    ids: IntArray,
) -> int:
    """Write the horizons of n pairs that may see each other to rows (>= n, FIELDS), ids (>= n, 4).

    visibility (n,) is their class; tolerance in metres. Returns the number of rows written.
    """
    planes = np.empty((5, 4))
    segment = np.empty((2, 3))
    scratch = np.empty((8, 3))
    used = 0
    for pair in range(len(receivers)):
        if visibility[pair] == NONE:
            continue
        r = receivers[pair]
        s = sources[pair]
        ns = polygons.normals[s]
        nr = polygons.normals[r]
        lowest, highest = heights(polygons.corners[r], polygons.counts[r], polygons.corners[s, 0], ns)
        if lowest >= -tolerance or highest <= tolerance:
            continue
        if not cross_plane(polygons, r, polygons.corners[s, 0], ns, segment):
            continue
        o = polygons.corners[r, 0]
        for end in range(2):
            for axis in range(3):
                segment[end, axis] -= o[axis]
        sides = receiver_planes(polygons, r, planes)
        if not counts_as_segment(planes, sides, segment, patch_diameter(polygons, r)):
            continue
        write_segment(polygons, r, s, -1, HORIZON, segment, used, rows, ids)
        rows[used, 6] = 1.0
        # Across the line on the receiver, towards the source's front.
        cosine = ns[0] * nr[0] + ns[1] * nr[1] + ns[2] * nr[2]
        sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
        size = patch_diameter(polygons, s)
        for sample in range(SAMPLES):
            t = sample / (SAMPLES - 1.0)
            near = 0.0
            far = 0.0
            for step in (_NEAR * size, size):
                x = np.empty(3)
                for axis in range(3):
                    x[axis] = o[axis] + segment[0, axis] + t * (segment[1, axis] - segment[0, axis])
                    x[axis] += step * (ns[axis] - cosine * nr[axis]) / sine
                near = far
                far = point_form_factor(
                    x[0], x[1], x[2], nr[0], nr[1], nr[2], polygons.corners[s], polygons.counts[s], scratch
                )
            factor = max(near, far)
            rows[used, 7 + sample] = factor
            rows[used, 7 + SAMPLES + sample] = math.inf
            if near > 0.0:
                rows[used, 7 + SAMPLES + sample] = factor * _NEAR * size / near
            rows[used, 7 + 2 * SAMPLES + sample] = math.inf
        used += 1
    return used
