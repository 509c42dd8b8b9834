"""How strong a VE or EV discontinuity is at a point of it: the geometry behind its weight ([H 5.3, 8.2]).

Let a point move across the discontinuity. Seen from there, the blocker's edge (or corner) moves over the
source at `scale` metres per metre: d_sb / d_br, times the sines at which the wedge of sight lines meets
receiver and source. What it hides is swept by the line in which the wedge cuts the source, and the length
of what is swept of that line bends at the discontinuity by the difference of the cotangents of the angles
between the line and the two sides of the corner that passes: of the source's corner (VE) or the blocker's
(EV). So, per W/m2 of the source's radiosity,

* the second derivative of the irradiance jumps by bend = |cot - cot| g scale^2, with g the form factor per
  area of source at the corner;
* where a side is parallel to the line the jump is in the first derivative, and at most form factor /
  width: the penumbra is area of source / (length of the line . scale) wide.
"""

from __future__ import annotations

import math

from solver.illumination.discontinuity.segments import Polygons
from solver.kernels import kernel
from solver.transport.lambert import point_form_factor
from solver.types import FloatArray


@kernel
def _longest_chord(
    polygons: Polygons, source: int, lx: float, ly: float, lz: float, qx: float, qy: float, qz: float
) -> float:
    """Bound of the longest chord of a patch along l: a convex polygon fills half of chord times breadth."""
    low_l = math.inf
    high_l = -math.inf
    low_q = math.inf
    high_q = -math.inf
    for k in range(polygons.counts[source]):
        c = polygons.corners[source, k]
        o = polygons.corners[source, 0]
        along = lx * (c[0] - o[0]) + ly * (c[1] - o[1]) + lz * (c[2] - o[2])
        across = qx * (c[0] - o[0]) + qy * (c[1] - o[1]) + qz * (c[2] - o[2])
        low_l = min(low_l, along)
        high_l = max(high_l, along)
        low_q = min(low_q, across)
        high_q = max(high_q, across)
    return float(min(high_l - low_l, 2.0 * polygons.areas[source] / (high_q - low_q)))


@kernel
def wedge_strength(
    polygons: Polygons,
    receiver: int,
    source: int,
    x: FloatArray,
    b: FloatArray,
    s: FloatArray,
    normal: FloatArray,
    rays: FloatArray,
    ray_count: int,
    cuts: FloatArray,
    cut_count: int,
    reach: float,
    tolerance: float,
    scratch: FloatArray,
) -> tuple[float, float, float, float]:
    """d_sb / d_br, form factor, penumbra width (m) and bend (1/m2) at the point x of a discontinuity.

    x, b, s (3,): on receiver, blocker and source, in a line; normal (3,) of the wedge. rays (n, 3) are the
    sides of the corner that passes (of which there should be two), cuts (n, 3) the blocker's edges, in full
    length; reach: length (m) of the line that can be swept on the source, infinite to find it out. Lengths
    below `tolerance` count as that; scratch (8, 3).
    """
    nr = polygons.normals[receiver]
    ns = polygons.normals[source]
    kx = s[0] - x[0]
    ky = s[1] - x[1]
    kz = s[2] - x[2]
    d_sr = max(tolerance, math.sqrt(kx * kx + ky * ky + kz * kz))
    kx /= d_sr
    ky /= d_sr
    kz /= d_sr
    d_sb = math.sqrt((s[0] - b[0]) ** 2 + (s[1] - b[1]) ** 2 + (s[2] - b[2]) ** 2)
    d_br = max(tolerance, math.sqrt((b[0] - x[0]) ** 2 + (b[1] - x[1]) ** 2 + (b[2] - x[2]) ** 2))
    factor = point_form_factor(
        x[0], x[1], x[2], nr[0], nr[1], nr[2], polygons.corners[source], polygons.counts[source], scratch
    )
    # Axes on the source: l along the wedge's cut, q across.
    cosine_r = normal[0] * nr[0] + normal[1] * nr[1] + normal[2] * nr[2]
    sine_r = math.sqrt(max(0.0, 1.0 - cosine_r * cosine_r))
    lx = normal[1] * ns[2] - normal[2] * ns[1]
    ly = normal[2] * ns[0] - normal[0] * ns[2]
    lz = normal[0] * ns[1] - normal[1] * ns[0]
    sine_s = math.sqrt(lx * lx + ly * ly + lz * lz)
    if sine_s <= 0.0 or sine_r <= 0.0:
        return d_sb / d_br, factor, math.inf, 0.0
    lx /= sine_s
    ly /= sine_s
    lz /= sine_s
    qx = ns[1] * lz - ns[2] * ly
    qy = ns[2] * lx - ns[0] * lz
    qz = ns[0] * ly - ns[1] * lx
    scale = d_sb / d_br * sine_r / sine_s
    out_of_source = -(ns[0] * kx + ns[1] * ky + ns[2] * kz)
    if math.isinf(reach):
        reach = _longest_chord(polygons, source, lx, ly, lz, qx, qy, qz)
    # What is swept is no longer than the blocker's edges, seen on the source from x.
    seen = 0.0
    for i in range(cut_count):
        lean = (ns[0] * cuts[i, 0] + ns[1] * cuts[i, 1] + ns[2] * cuts[i, 2]) / out_of_source
        dx = cuts[i, 0] + kx * lean
        dy = cuts[i, 1] + ky * lean
        dz = cuts[i, 2] + kz * lean
        seen = max(seen, math.sqrt(dx * dx + dy * dy + dz * dz) * d_sr / d_br)
    reach = min(reach, seen)
    width = math.inf
    if reach > 0.0:
        width = polygons.areas[source] / (reach * scale)
    # The corner that passes, seen on the source.
    least = math.inf
    most = -math.inf
    for i in range(ray_count):
        lean = (ns[0] * rays[i, 0] + ns[1] * rays[i, 1] + ns[2] * rays[i, 2]) / out_of_source
        dx = rays[i, 0] + kx * lean
        dy = rays[i, 1] + ky * lean
        dz = rays[i, 2] + kz * lean
        cotangent = (dx * lx + dy * ly + dz * lz) / (dx * qx + dy * qy + dz * qz)
        least = min(least, cotangent)
        most = max(most, cotangent)
    corner = math.inf
    if ray_count >= 2 and most - least < math.inf:
        corner = (ray_count - 1) * (most - least)
    cosine_x = nr[0] * kx + nr[1] * ky + nr[2] * kz
    density = max(0.0, cosine_x * out_of_source) / (math.pi * d_sr * d_sr)
    bend = 0.0
    if density > 0.0:
        bend = corner * density * scale * scale
    return d_sb / d_br, factor, width, bend
