"""One wave of the random walk: paths arrive at what their rays hit, collect light, and go on.

The radiosity equation, B(x) = E(x) + rho(x) H(x) with H(x) = mean of B over cosine-distributed
directions, is walked from the receiver; where radiance has a direction, B is pi times that towards the
receiver. What reflects specularly does so in `solver.pathtracing.specular`.

Paths end by Russian roulette on the albedo alone, which is unbiased however large the albedo; the first
bounces are exempt. Whether a path survives moves a counter and not the flow, see
`solver.pathtracing.connect`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.kernels import inline_kernel, kernel
from solver.pathtracing.connect import cast_shadow_ray
from solver.pathtracing.lobes import emission_lobe, reflects_specularly
from solver.pathtracing.paths import Paths, ShadowRays, write_path
from solver.pathtracing.sampling import cosine_direction, pair, single
from solver.pathtracing.specular import reflect
from solver.pathtracing.tables import Emitters, ShadingTables
from solver.types import BoolArray, FloatArray, IntArray

ROULETTE_VERTEX: Final = 2
"""Number of the first vertex at which Russian roulette is played."""


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
    """Write at `row` the ray on which a path leaves its lifted, diffuse (x, y, z), vertex number `vertex`."""
    u, v = pair(stream, index, 2 * vertex + 2)
    dx, dy, dz, cosine = cosine_direction(nx, ny, nz, u, v)
    write_path(paths, row, x, y, z, dx, dy, dz, cosine, red, green, blue, item, vertex + 1, stream, index)


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

        # Emission: in full for cameras and mirrors, else shared with emitter sampling.
        red, green, blue = paths.throughput[i, 0], paths.throughput[i, 1], paths.throughput[i, 2]
        item = paths.item[i]
        q = tables.density[patch]
        if q > 0.0:
            weight = emission_lobe(tables.lobes, patch, abs(towards), 1.0)
            if paths.spread[i] >= 0.0:
                p = paths.spread[i] * abs(towards) / (math.pi * t * t)
                weight = weight / (1.0 + q / p)  # p is infinite where the surfaces touch
            sums[item, 0] += red * weight * tables.emission[patch, 0]
            sums[item, 1] += green * weight * tables.emission[patch, 1]
            sums[item, 2] += blue * weight * tables.emission[patch, 2]

        # Reflection.
        vertex, stream, index = paths.vertex[i], paths.stream[i], paths.sample[i]
        if reflects_specularly(tables.lobes, patch):
            kept, cast = reflect(
                tables.lobes, tables, emitters, paths, shadows, kept, cast, patch, x, y, z, dx, dy, dz,
                red, green, blue, item, vertex, stream, index, vertex >= ROULETTE_VERTEX,
            )  # fmt: skip
            continue
        albedo = max(tables.reflectance[patch, 0], tables.reflectance[patch, 1], tables.reflectance[patch, 2])
        if albedo <= 0.0:
            continue
        red *= tables.reflectance[patch, 0]
        green *= tables.reflectance[patch, 1]
        blue *= tables.reflectance[patch, 2]
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
