"""Particles leave their surfaces and arrive at others: what a walk does for each of them ([K 3.2, 4.2])."""

from __future__ import annotations

import math
from typing import Final

from solver.illumination.particles.emission import choose, lobe_direction, point_on_patch
from solver.illumination.particles.path_numbers import hashed
from solver.illumination.particles.walk_tables import Particles, Tables
from solver.kernels import inline_kernel, kernel
from solver.types import FloatArray, Int64Array, IntArray

DECISIONS: Final = 1 << 40
"""Dimensions from here on are those of decisions at reflections: far beyond any pair of a direction's."""

ABSORPTIONS: Final = 2 * DECISIONS
"""Dimensions from here on decide whether a path goes on to a generation."""

SURE_PIECES: Final = 2
"""Specular reflections in a row that none is absorbed at; later ones absorb at random, so that they end."""


@kernel
def emit(
    numbers: FloatArray,
    patch: IntArray,
    cumulative: FloatArray,
    power: FloatArray,
    tables: Tables,
    particles: Particles,
) -> None:
    """Place all particles on emitters by numbers (n, 2); the emitters are those of `Emitters`."""
    for i in range(len(numbers)):
        k, u = choose(cumulative, numbers[i, 0])
        p = patch[k]
        x, y, z = point_on_patch(tables.corners[p], tables.normal[p], u, numbers[i, 1])
        particles.position[i, 0], particles.position[i, 1], particles.position[i, 2] = x, y, z
        particles.patch[i] = p
        particles.lobe[i] = tables.emission_exponent[p] + 1.0
        for axis in range(3):
            particles.normal[i, axis] = tables.normal[p, axis]
            particles.incident[i, axis] = 0.0
            particles.carried[i, axis] = power[k, axis]


@kernel
def absorb(
    rows: Int64Array,
    survival: FloatArray,
    seed: int,
    first: int,
    generation: int,
    particles: Particles,
    kept: Int64Array,
) -> int:
    """Absorb the particles `rows` (n,) at random; those that survive, by `survival` (n,), carry the more.

    They are listed in kept (n,); returns how many there are.
    """
    count = 0
    for k in range(len(rows)):
        i = rows[k]
        if hashed(seed, first + i, ABSORPTIONS + generation) < survival[k]:
            for axis in range(3):
                particles.carried[i, axis] /= survival[k]
            kept[count] = i
            count += 1
    return count


@kernel
def leave(rows: Int64Array, numbers: FloatArray, tables: Tables, particles: Particles) -> None:
    """Send the particles `rows` (n,) off in their lobes by numbers (n, 2)."""
    for k in range(len(rows)):
        i = rows[k]
        nx, ny, nz = particles.normal[i, 0], particles.normal[i, 1], particles.normal[i, 2]
        _send(
            particles,
            i,
            tables.offset,
            lobe_direction(nx, ny, nz, particles.lobe[i], numbers[k, 0], numbers[k, 1]),
        )


@inline_kernel
def _send(particles: Particles, i: int, offset: float, direction: tuple[float, float, float]) -> None:
    for axis in range(3):
        particles.direction[i, axis] = direction[axis]
        particles.origin[i, axis] = particles.position[i, axis] + offset * particles.normal[i, axis]


@inline_kernel
def _decide(seed: int, path: int, generation: int, piece: int, which: int) -> float:
    """A number for a decision of a path: after so many specular pieces on its way to a generation."""
    return hashed(seed, path, DECISIONS + 4 * ((generation << 24) + piece) + which)


@kernel
def arrive(
    rows: Int64Array,
    triangle: IntArray,
    distance: FloatArray,
    seed: int,
    first: int,
    generation: int,
    piece: int,
    tables: Tables,
    particles: Particles,
    diffuse: Int64Array,
    specular: Int64Array,
) -> tuple[int, int]:
    """Take the particles `rows` (n,) to what their rays hit: `triangle` (n,) or -1, `distance` (n,) m away.

    Which reflection they go on by is decided at random, by what either would leave of them [K 4.2]. Those of
    a diffuse one are listed in diffuse (n,), those of a specular one in specular (n,); the others have
    ended. Returns the lengths of both lists.
    """
    matt, shiny = 0, 0
    for k in range(len(rows)):
        i, hit = rows[k], triangle[k]
        if hit < 0:
            continue
        # Which side was hit; a black one absorbs.
        towards = 0.0
        for axis in range(3):
            towards += particles.direction[i, axis] * tables.facing[hit, axis]
        patch = tables.triangle_patch[hit, 0 if towards < 0.0 else 1]
        if patch < 0:
            continue

        # Diffuse or specular. All channels count alike, so that none becomes more than all have been.
        by_diffuse, by_specular = 0.0, 0.0
        for axis in range(3):
            by_diffuse += particles.carried[i, axis] * tables.reflectance[patch, axis]
            by_specular += particles.carried[i, axis] * tables.specular[patch, axis]
        either = by_diffuse + by_specular
        if not either > 0.0:
            continue
        is_specular = by_specular > 0.0 and (
            _decide(seed, first + i, generation, piece, 0) * either < by_specular
        )
        weight = either / (by_specular if is_specular else by_diffuse)
        albedo = tables.specular[patch] if is_specular else tables.reflectance[patch]

        # Embree's point, put back on the plane in float64.
        height = 0.0
        for axis in range(3):
            reached = particles.origin[i, axis] + distance[k] * particles.direction[i, axis]
            particles.position[i, axis] = reached
            height += (tables.anchor[hit, axis] - reached) * tables.normal[patch, axis]
        for axis in range(3):
            particles.position[i, axis] += height * tables.normal[patch, axis]
            particles.normal[i, axis] = tables.normal[patch, axis]
            particles.incident[i, axis] = particles.direction[i, axis]
            particles.carried[i, axis] *= weight * albedo[axis]
        particles.lobe[i] = 1.0
        particles.patch[i] = patch
        if is_specular:
            specular[shiny] = i
            shiny += 1
        else:
            diffuse[matt] = i
            matt += 1
    return matt, shiny


@kernel
def reflect(
    rows: Int64Array,
    seed: int,
    first: int,
    generation: int,
    piece: int,
    tables: Tables,
    particles: Particles,
    going: Int64Array,
) -> int:
    """Send the particles `rows` (n,) on by specular reflection where they are; returns how many go on.

    Those are listed in going (n,). A lobe has the density (n + 1) / (2 pi) cos^n(alpha) about the mirrored
    direction, and reflects (n + 2) / (2 pi) cos^n(alpha) cos(theta): nothing below the horizon.
    """
    count = 0
    for k in range(len(rows)):
        i = rows[k]
        patch = particles.patch[i]
        if piece >= SURE_PIECES:
            survival = max(tables.specular[patch, 0], tables.specular[patch, 1], tables.specular[patch, 2])
            if _decide(seed, first + i, generation, piece, 1) >= survival:
                continue
            for axis in range(3):
                particles.carried[i, axis] /= survival
        nx, ny, nz = particles.normal[i, 0], particles.normal[i, 1], particles.normal[i, 2]
        dx, dy, dz = particles.incident[i, 0], particles.incident[i, 1], particles.incident[i, 2]
        twice = 2.0 * (dx * nx + dy * ny + dz * nz)
        x, y, z = dx - twice * nx, dy - twice * ny, dz - twice * nz
        exponent = tables.exponent[patch]
        if exponent < math.inf:
            u = _decide(seed, first + i, generation, piece, 2)
            v = _decide(seed, first + i, generation, piece, 3)
            x, y, z = lobe_direction(x, y, z, exponent, u, v)
            cosine = x * nx + y * ny + z * nz
            if cosine <= 0.0:
                continue
            for axis in range(3):
                particles.carried[i, axis] *= (exponent + 2.0) / (exponent + 1.0) * cosine
        _send(particles, i, tables.offset, (x, y, z))
        going[count] = i
        count += 1
    return count
