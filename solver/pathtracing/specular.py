"""What happens to a path at a vertex that reflects specularly, beside what it reflects diffusely.

A path goes on by the lobe about the mirrored direction or by the cosine, one or the other. Weights and
emitter sampling know the density of both together, so that whatever the lobe is worth in a direction, its
share of the density is there as well: no weight exceeds 1.5 times the reflectance, however narrow the lobe,
and the light of an emitter counts by whichever of ray and shadow ray is the denser there.

A perfect mirror is a direction and no density. The light that it shows is counted where the mirrored ray
hits it; shadow rays are for the diffuse part, whose density is what the mirror leaves of the chance.

Which way to go is decided by what each way is worth to the path as it is, channel by channel: a path whose
light is blue by now does not ask a red lobe. Roulette is on what is left of that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from solver.kernels import inline_kernel
from solver.pathtracing.connect import emitter_point, write_shadow_ray
from solver.pathtracing.lobes import Lobes, emission_lobe, mirrored, phong_lobe, specular_chance
from solver.pathtracing.paths import Paths, ShadowRays, write_path
from solver.pathtracing.sampling import cosine_direction, lobe_direction, pair, single
from solver.pathtracing.tables import Emitters, ShadingTables


class Scattering(NamedTuple):
    """How a vertex passes on what a path brings."""

    patch: int
    exponent: float
    """Infinite for a mirror"""
    x: float
    """The mirrored direction is (x, y, z), unit"""
    y: float
    z: float
    chance: float
    """Probability of the lobe, or the mirror; the rest is that of the cosine"""


@inline_kernel
def reflect(
    lobes: Lobes | None,
    tables: ShadingTables,
    emitters: Emitters,
    paths: Paths,
    shadows: ShadowRays,
    kept: int,
    cast: int,
    patch: int,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    red: float,
    green: float,
    blue: float,
    item: int,
    vertex: int,
    stream: np.uint64,
    index: np.uint64,
    roulette: bool,
) -> tuple[int, int]:
    """Reflect at the lifted (x, y, z) of `patch` a path that arrives along (dx, dy, dz).

    Writes the path at `kept` and a shadow ray at `cast`; returns how many paths and shadow rays are then in
    use. `roulette` says whether the path may end by chance.
    """
    if lobes is None:
        return kept, cast
    nx, ny, nz = tables.normal[patch, 0], tables.normal[patch, 1], tables.normal[patch, 2]
    rx, ry, rz = mirrored(dx, dy, dz, nx, ny, nz)

    # What the two ways are worth.
    exponent = lobes.exponent[patch]
    diffuse = max(
        red * tables.reflectance[patch, 0],
        green * tables.reflectance[patch, 1],
        blue * tables.reflectance[patch, 2],
    )
    specular = max(
        red * lobes.specular[patch, 0], green * lobes.specular[patch, 1], blue * lobes.specular[patch, 2]
    )
    if diffuse + specular <= 0.0:
        return kept, cast
    scattering = Scattering(patch, exponent, rx, ry, rz, specular_chance(exponent, specular, diffuse))

    # Light from the emitters, but what only a mirror could pass on.
    if diffuse > 0.0 or not math.isinf(exponent):
        u, v = pair(stream, index, 2 * vertex + 1)
        cast = cast_scattered(
            lobes, tables, emitters, shadows, cast, scattering,
            x, y, z, nx, ny, nz, red, green, blue, item, u, v,
        )  # fmt: skip

    # On by the lobe, the mirror, or the cosine.
    u, v = pair(stream, index, 2 * vertex + 2)
    dx, dy, dz, spread, by_cosine, by_lobe = scattered_direction(scattering, nx, ny, nz, u, v)
    if spread == 0.0:
        return kept, cast
    brought = max(red, green, blue)
    red *= by_cosine * tables.reflectance[patch, 0] + by_lobe * lobes.specular[patch, 0]
    green *= by_cosine * tables.reflectance[patch, 1] + by_lobe * lobes.specular[patch, 1]
    blue *= by_cosine * tables.reflectance[patch, 2] + by_lobe * lobes.specular[patch, 2]

    # Russian roulette, by what is left.
    survival = min(max(red, green, blue) / brought, 1.0) if roulette else 1.0
    if single(stream, index, vertex) >= survival:
        return kept, cast
    red, green, blue = red / survival, green / survival, blue / survival
    write_path(paths, kept, x, y, z, dx, dy, dz, spread, red, green, blue, item, vertex + 1, stream, index)
    return kept + 1, cast


@inline_kernel
def scattered_direction(
    scattering: Scattering, nx: float, ny: float, nz: float, u: float, v: float
) -> tuple[float, float, float, float, float, float]:
    """A direction in which a vertex of that unit normal passes light on.

    Returns the direction, pi times its density per steradian, and what the diffuse and the specular
    reflectance count by. The density is -1 for a mirror, and 0 where the lobe leads below the surface.
    """
    chance, exponent = scattering.chance, scattering.exponent
    rx, ry, rz = scattering.x, scattering.y, scattering.z
    if u < chance:
        if math.isinf(exponent):
            return rx, ry, rz, -1.0, 0.0, 1.0 / chance
        dx, dy, dz, along = lobe_direction(rx, ry, rz, exponent, u / chance, v)
        cosine = dx * nx + dy * ny + dz * nz
    else:
        dx, dy, dz, cosine = cosine_direction(nx, ny, nz, (u - chance) / (1.0 - chance), v)
        along = dx * rx + dy * ry + dz * rz
    if cosine <= 0.0:
        return dx, dy, dz, 0.0, 0.0, 0.0
    lobe = phong_lobe(exponent, along)
    spread = spread_of(scattering, cosine, lobe)
    return dx, dy, dz, spread, cosine / spread, lobe * cosine / spread


@inline_kernel
def spread_of(scattering: Scattering, cosine: float, lobe: float) -> float:
    """pi times the density per steradian of directions of that cosine and that value of the lobe."""
    narrow = 0.0
    if lobe > 0.0:
        narrow = lobe * (scattering.exponent + 1.0) / (scattering.exponent + 2.0)
    spread: float = (1.0 - scattering.chance) * cosine + scattering.chance * narrow
    return spread


@inline_kernel
def cast_scattered(
    lobes: Lobes,
    tables: ShadingTables,
    emitters: Emitters,
    shadows: ShadowRays,
    row: int,
    scattering: Scattering,
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
    """As `cast_shadow_ray`, for a vertex that scatters; the throughput is that before its reflection."""
    if len(emitters.patch) == 0:
        return row
    source, tx, ty, tz = emitter_point(emitters, u, v)
    mx, my, mz = tables.normal[source, 0], tables.normal[source, 1], tables.normal[source, 2]
    dx, dy, dz = tx - x, ty - y, tz - z
    leaving = dx * nx + dy * ny + dz * nz
    arriving = -(dx * mx + dy * my + dz * mz)
    if leaving <= 0.0 or arriving <= 0.0:
        return row
    squared = dx * dx + dy * dy + dz * dz
    distance = math.sqrt(squared)

    # What the diffuse part gets by one sample, per area, and the density of the ray there.
    lobe = phong_lobe(
        scattering.exponent, (dx * scattering.x + dy * scattering.y + dz * scattering.z) / distance
    )
    cosine = leaving / distance
    seen = arriving / (math.pi * squared * distance)
    p = spread_of(scattering, cosine, lobe) * seen
    weight = emission_lobe(lobes, source, arriving, squared) * cosine * seen / (tables.density[source] + p)
    patch = scattering.patch
    write_shadow_ray(
        tables, shadows, row, x, y, z, source, tx, ty, tz,
        red * weight * (tables.reflectance[patch, 0] + lobe * lobes.specular[patch, 0]),
        green * weight * (tables.reflectance[patch, 1] + lobe * lobes.specular[patch, 1]),
        blue * weight * (tables.reflectance[patch, 2] + lobe * lobes.specular[patch, 2]),
        item,
    )  # fmt: skip
    return row + 1
