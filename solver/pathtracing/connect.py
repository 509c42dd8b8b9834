"""Shadow rays: points chosen on the emitters, joined to the vertices of paths.

Emission is collected at every vertex twice, by a point chosen on the emitters and by the ray that happens to
hit one, and the two are weighed by the balance heuristic (Veach 1997, ch. 9). With p the density of the ray
and q that of emitter sampling, both per area of the emitter, a diffuse vertex then gets E p / (p + q) at most
by either: the singularity of p at an emitter that touches its receiver is gone, which plain emitter sampling,
E p / q, does not survive.

Whether the emitter's point faces the receiver is a toss-up: it moves a counter and not the flow. A row is
written always and kept or not. A mispredicted branch there waits for the whole chain from the hash to the
outcome, and made the kernel three times slower.
"""

from __future__ import annotations

import math

from solver.kernels import inline_kernel
from solver.pathtracing.lobes import emission_lobe
from solver.pathtracing.paths import ShadowRays
from solver.pathtracing.sampling import triangle_weights
from solver.pathtracing.tables import Emitters, ShadingTables
from solver.types import FloatArray


@inline_kernel
def find_interval(cumulative: FloatArray, u: float) -> int:
    """Index k with cumulative[k] <= u < cumulative[k + 1]."""
    low, high = 0, len(cumulative) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if cumulative[middle] <= u:
            low = middle
        else:
            high = middle
    return low


@inline_kernel
def emitter_point(emitters: Emitters, u: float, v: float) -> tuple[int, float, float, float]:
    """A point of the emitters, and the patch that it lies on. There must be one."""
    # Choose a triangle by power, then a point by area; what is left of u serves again.
    k = find_interval(emitters.cumulative, u)
    below, above = emitters.cumulative[k], emitters.cumulative[k + 1]
    b, c = triangle_weights((u - below) / (above - below), v)
    tx = emitters.corner[k, 0] + b * emitters.first_edge[k, 0] + c * emitters.second_edge[k, 0]
    ty = emitters.corner[k, 1] + b * emitters.first_edge[k, 1] + c * emitters.second_edge[k, 1]
    tz = emitters.corner[k, 2] + b * emitters.first_edge[k, 2] + c * emitters.second_edge[k, 2]
    return emitters.patch[k], tx, ty, tz


@inline_kernel
def cast_shadow_ray(
    tables: ShadingTables,
    emitters: Emitters,
    shadows: ShadowRays,
    row: int,
    x: float,
    y: float,
    z: float,
    nx: float,
    ny: float,
    nz: float,
    red: float,
    green: float,
    blue: float,
    item: int,
    u: float,
    v: float,
) -> int:
    """Choose a point of the emitters for the lifted, diffuse (x, y, z) and write its shadow ray at `row`.

    The throughput is (red, green, blue). Returns the number of rows then in use.
    """
    if len(emitters.patch) == 0:
        return row
    patch, tx, ty, tz = emitter_point(emitters, u, v)
    mx, my, mz = tables.normal[patch, 0], tables.normal[patch, 1], tables.normal[patch, 2]

    # Density p of the cosine-distributed ray at that point, and the balance heuristic's p / (p + q).
    dx, dy, dz = tx - x, ty - y, tz - z
    leaving = dx * nx + dy * ny + dz * nz
    arriving = -(dx * mx + dy * my + dz * mz)
    squared = dx * dx + dy * dy + dz * dz
    p = leaving * arriving / (math.pi * squared * squared)
    weight = emission_lobe(tables.lobes, patch, arriving, squared) / (1.0 + tables.density[patch] / p)
    write_shadow_ray(
        tables, shadows, row, x, y, z, patch, tx, ty, tz, red * weight, green * weight, blue * weight, item
    )
    # The row is kept if the point faces the receiver. No branch: see the top.
    used: int = row + ((leaving > 0.0) & (arriving > 0.0))
    return used


@inline_kernel
def write_shadow_ray(
    tables: ShadingTables,
    shadows: ShadowRays,
    row: int,
    x: float,
    y: float,
    z: float,
    patch: int,
    tx: float,
    ty: float,
    tz: float,
    red: float,
    green: float,
    blue: float,
    item: int,
) -> None:
    """Write at `row` a segment from (x, y, z) to (tx, ty, tz) on `patch`; colours are per its emission."""
    lift = tables.offset
    shadows.origin[row, 0], shadows.origin[row, 1], shadows.origin[row, 2] = x, y, z
    shadows.target[row, 0] = tx + lift * tables.normal[patch, 0]
    shadows.target[row, 1] = ty + lift * tables.normal[patch, 1]
    shadows.target[row, 2] = tz + lift * tables.normal[patch, 2]
    shadows.energy[row, 0] = red * tables.emission[patch, 0]
    shadows.energy[row, 1] = green * tables.emission[patch, 1]
    shadows.energy[row, 2] = blue * tables.emission[patch, 2]
    shadows.item[row] = item
