"""Irradiance by virtual lights as it is written down: each light at each point, by a ray of its own."""

from __future__ import annotations

import numpy as np

from solver.illumination.particles.lights import VirtualLights
from solver.types import BoolArray, FloatArray, Int64Array, Points
from tests.illumination.particles.rooms import Room


def irradiance_of(lights: VirtualLights, points: Points, normals: FloatArray, room: Room) -> FloatArray:
    """(n, 3) W/m2 at points (n, 3) with unit normals (n, 3), images through their mirrors included."""
    total = np.zeros((len(points), 3))
    for start in range(0, len(lights), 2048):
        part = lights.take(np.arange(start, min(start + 2048, len(lights))))
        towards = part.position - points[:, None]
        squared = np.einsum("nma,nma->nm", towards, towards)
        here = np.einsum("nma,na->nm", towards, normals)
        at, of = np.nonzero((here > 0.0) & (squared > 0.0))
        out = -towards[at, of] / np.sqrt(squared[at, of])[:, None]
        seen = _intensity(part, out, of) > 0.0
        at, of, out = at[seen], of[seen], out[seen]
        visible = _visible(part, points[at], normals[at], of, room)
        at, of, out = at[visible], of[visible], out[visible]
        cosine = here[at, of] / np.sqrt(squared[at, of])
        geometry = np.zeros(squared.shape)
        geometry[at, of] = _intensity(part, out, of) * cosine / squared[at, of]
        total += geometry @ part.power
    return total


def _intensity(lights: VirtualLights, out: FloatArray, of: Int64Array) -> FloatArray:
    """Radiant intensity (k,) of lights `of` (k,) in directions (k, 3), for a power of 1 W."""
    normal, lobe, gloss = lights.normal[of], lights.lobe[of], lights.gloss[of]
    cosine = np.maximum(np.einsum("ka,ka->k", out, normal), 0.0)
    plain = (lobe + 1.0) / (2.0 * np.pi) * cosine**lobe
    incident = lights.incident[of]
    mirrored = incident - 2.0 * np.einsum("ka,ka->k", incident, normal)[:, None] * normal
    n = np.maximum(gloss, 0.0)
    alpha = np.maximum(np.einsum("ka,ka->k", out, mirrored), 0.0)
    return np.asarray(np.where(gloss < 0.0, plain, (n + 2.0) / (2.0 * np.pi) * alpha**n * cosine))


def _visible(
    lights: VirtualLights, points: Points, normals: FloatArray, of: Int64Array, room: Room
) -> BoolArray:
    """Whether points (k, 3) see lights `of` (k,), by way of the mirror where there is one."""
    surfaces, rays = room.surfaces, room.rays
    offset = rays.offset / rays.scale
    start = points + offset * normals
    end = lights.position[of] + offset * lights.normal[of]
    mirror = lights.mirror[of]
    seen = np.ones(len(of), dtype=np.bool_)
    direct = mirror < 0
    seen[direct] = ~rays.occluded(start[direct], end[direct])

    # Where the straight line to the image crosses the mirror, inside of its polygon.
    which = np.flatnonzero(~direct)
    patch, a, b = mirror[which], start[which], end[which]
    normal, corners = surfaces.normal[patch], surfaces.corners[patch]
    before = np.einsum("ka,ka->k", a - corners[:, 0], normal)
    behind = np.einsum("ka,ka->k", b - corners[:, 0], normal)
    crosses = (before > 0.0) & (behind < 0.0)
    share = np.where(crosses, before / np.where(crosses, before - behind, 1.0), 0.0)
    on = a + share[:, None] * (b - a)
    edges = np.roll(corners, -1, axis=1) - corners
    left = np.einsum("kna,ka->kn", np.cross(edges, on[:, None] - corners), normal)
    crosses &= (left >= 0.0).all(axis=1)
    # Both parts of the way, on the mirror's front.
    light = b - 2.0 * behind[:, None] * normal
    on += offset * normal
    seen[which] = crosses & ~rays.occluded(a, on) & ~rays.occluded(on, light)
    return seen
