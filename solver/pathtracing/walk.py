"""One wave of the random walk: paths arrive at what their rays hit, collect light, and go on.

The radiosity equation, B(x) = E(x) + rho(x) H(x) with H(x) = mean of B over cosine-distributed
directions, is walked from the receiver. Emission is collected at every vertex twice, by a point chosen
on the emitters and by the ray that happens to hit one, and the two are weighed by the balance heuristic
(Veach 1997, ch. 9). With p the density of the cosine-distributed ray and q that of emitter sampling,
both per area of the emitter, either strategy then adds E p / (p + q) at most: the singularity of p at
an emitter that touches its receiver is gone, which plain emitter sampling, E p / q, does not survive.

Paths end by Russian roulette on the albedo alone, which is unbiased however large the albedo; the first
bounces are exempt.

Outcomes that are a toss-up (does the emitter's point face the receiver, does the path survive) move a
counter and not the flow: a row is written always and kept or not. A mispredicted branch there waits for
the whole chain from the hash to the outcome, and made the kernel three times slower.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.pathtracing.paths import Paths, ShadowRays
from solver.pathtracing.sampling import cosine_direction, pair, single, triangle_weights
from solver.pathtracing.tables import Emitters, ShadingTables
from solver.types import BoolArray, FloatArray, IntArray

ROULETTE_VERTEX: Final = 2
"""Number of the first vertex at which Russian roulette is played."""


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
    """Choose a point of the emitters for the lifted receiver (x, y, z) and write its shadow ray at `row`.

    The throughput is (red, green, blue). Returns the number of rows then in use.
    """
    if len(emitters.patch) == 0:
        return row
    # Choose a triangle by power, then a point by area; what is left of u serves again.
    k = find_interval(emitters.cumulative, u)
    below, above = emitters.cumulative[k], emitters.cumulative[k + 1]
    b, c = triangle_weights((u - below) / (above - below), v)
    patch = emitters.patch[k]
    lift = tables.offset
    mx, my, mz = tables.normal[patch, 0], tables.normal[patch, 1], tables.normal[patch, 2]
    tx = emitters.corner[k, 0] + b * emitters.first_edge[k, 0] + c * emitters.second_edge[k, 0]
    ty = emitters.corner[k, 1] + b * emitters.first_edge[k, 1] + c * emitters.second_edge[k, 1]
    tz = emitters.corner[k, 2] + b * emitters.first_edge[k, 2] + c * emitters.second_edge[k, 2]

    # Density p of the cosine-distributed ray at that point, and the balance heuristic's p / (p + q).
    dx, dy, dz = tx - x, ty - y, tz - z
    leaving = dx * nx + dy * ny + dz * nz
    arriving = -(dx * mx + dy * my + dz * mz)
    squared = dx * dx + dy * dy + dz * dz
    p = leaving * arriving / (math.pi * squared * squared)
    weight = 1.0 / (1.0 + tables.density[patch] / p)
    shadows.origin[row, 0], shadows.origin[row, 1], shadows.origin[row, 2] = x, y, z
    shadows.target[row, 0] = tx + lift * mx
    shadows.target[row, 1] = ty + lift * my
    shadows.target[row, 2] = tz + lift * mz
    shadows.energy[row, 0] = red * weight * tables.emission[patch, 0]
    shadows.energy[row, 1] = green * weight * tables.emission[patch, 1]
    shadows.energy[row, 2] = blue * weight * tables.emission[patch, 2]
    shadows.item[row] = item
    # The row is kept if the point faces the receiver. No branch: see the top.
    used: int = row + ((leaving > 0.0) & (arriving > 0.0))
    return used


@inline_kernel
def leave_vertex(
    paths: Paths,
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
    vertex: int,
    stream: np.uint64,
    index: np.uint64,
) -> None:
    """Write at `row` the ray on which a path leaves its lifted vertex (x, y, z), number `vertex`."""
    u, v = pair(stream, index, 2 * vertex + 2)
    dx, dy, dz, cosine = cosine_direction(nx, ny, nz, u, v)
    paths.origin[row, 0], paths.origin[row, 1], paths.origin[row, 2] = x, y, z
    paths.direction[row, 0], paths.direction[row, 1], paths.direction[row, 2] = dx, dy, dz
    paths.cosine[row] = cosine
    paths.throughput[row, 0], paths.throughput[row, 1], paths.throughput[row, 2] = red, green, blue
    paths.item[row] = item
    paths.vertex[row] = vertex + 1
    paths.stream[row] = stream
    paths.sample[row] = index


@kernel
def arrive(
    alive: int,
    triangle: IntArray,
    distance: FloatArray,
    tables: ShadingTables,
    emitters: Emitters,
    paths: Paths,
    shadows: ShadowRays,
    sums: FloatArray,
) -> tuple[int, int]:
    """Take the first `alive` paths to what they hit (`triangle`, or -1, at `distance` metres).

    Adds the emission hit to `sums` (items, 3), writes shadow rays from row 0, and packs the paths that
    go on to the front. Returns the number of paths and of shadow rays.
    """
    kept, cast = 0, 0
    for i in range(alive):
        hit = triangle[i]
        if hit < 0:
            continue
        # Which side was hit; a black one absorbs.
        dx, dy, dz = paths.direction[i, 0], paths.direction[i, 1], paths.direction[i, 2]
        towards = dx * tables.facing[hit, 0] + dy * tables.facing[hit, 1] + dz * tables.facing[hit, 2]
        patch = tables.triangle_patch[hit, 0 if towards < 0.0 else 1]
        if patch < 0:
            continue
        nx, ny, nz = tables.normal[patch, 0], tables.normal[patch, 1], tables.normal[patch, 2]

        # The vertex: Embree's point put back on the plane in float64, then lifted off it.
        t = distance[i]
        x = paths.origin[i, 0] + t * dx
        y = paths.origin[i, 1] + t * dy
        z = paths.origin[i, 2] + t * dz
        height = (
            nx * (tables.anchor[hit, 0] - x)
            + ny * (tables.anchor[hit, 1] - y)
            + nz * (tables.anchor[hit, 2] - z)
        ) + tables.offset
        x, y, z = x + height * nx, y + height * ny, z + height * nz

        # Emission: in full for the camera, else shared with emitter sampling.
        red, green, blue = paths.throughput[i, 0], paths.throughput[i, 1], paths.throughput[i, 2]
        item = paths.item[i]
        q = tables.density[patch]
        if q > 0.0:
            weight = 1.0
            if paths.cosine[i] >= 0.0:
                p = paths.cosine[i] * abs(towards) / (math.pi * t * t)
                weight = 1.0 / (1.0 + q / p)  # p is infinite where the surfaces touch
            sums[item, 0] += red * weight * tables.emission[patch, 0]
            sums[item, 1] += green * weight * tables.emission[patch, 1]
            sums[item, 2] += blue * weight * tables.emission[patch, 2]

        # Reflection.
        albedo = max(tables.reflectance[patch, 0], tables.reflectance[patch, 1], tables.reflectance[patch, 2])
        if albedo <= 0.0:
            continue
        red *= tables.reflectance[patch, 0]
        green *= tables.reflectance[patch, 1]
        blue *= tables.reflectance[patch, 2]
        vertex, stream, index = paths.vertex[i], paths.stream[i], paths.sample[i]
        u, v = pair(stream, index, 2 * vertex + 1)
        cast = cast_shadow_ray(
            tables, emitters, shadows, cast, x, y, z, nx, ny, nz, red, green, blue, item, u, v
        )

        # Russian roulette, by albedo.
        survival = albedo if vertex >= ROULETTE_VERTEX else 1.0
        red, green, blue = red / survival, green / survival, blue / survival
        leave_vertex(paths, kept, x, y, z, nx, ny, nz, red, green, blue, item, vertex, stream, index)
        kept += single(stream, index, vertex) < survival
    return kept, cast


@kernel
def deposit(count: int, blocked: BoolArray, shadows: ShadowRays, sums: FloatArray) -> None:
    """Add the light of the first `count` shadow rays that are not `blocked` (count,) to `sums` (items, 3)."""
    for j in range(count):
        if not blocked[j]:
            item = shadows.item[j]
            sums[item, 0] += shadows.energy[j, 0]
            sums[item, 1] += shadows.energy[j, 1]
            sums[item, 2] += shadows.energy[j, 2]
