"""Lights as they are wished for, points to light, and what maps of sights let through to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.geometry.scene import Material, Mesh, SceneObject
from solver.illumination.particles.lighting import ShiningLights, add_light
from solver.illumination.particles.lights import VirtualLights
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.sights import RESOLUTION, look_around
from solver.types import FloatArray, IntArray, Points
from tests.illumination.particles.rooms import CUBE, INWARD, Room
from tests.illumination.particles.twin import irradiance_of


def block(
    name: str, of: Material, low: Sequence[float], high: Sequence[float], inward: bool = False
) -> SceneObject:
    """A box from corner to corner, seen from outside unless it is a room."""
    corners = np.asarray(low) + CUBE * (np.asarray(high, dtype=float) - np.asarray(low))
    return SceneObject(name, Mesh(corners, INWARD if inward else tuple(face[::-1] for face in INWARD)), of)


def lamps(position: Points, normal: FloatArray, power: float = 1.0, lobe: float = 1.0) -> VirtualLights:
    """Point lights (m, 3) of `power` W in each channel, on no patch in particular."""
    count = len(position)
    nowhere = np.zeros(count, dtype=np.int32)
    return VirtualLights(
        position=np.asarray(position, dtype=float),
        normal=np.broadcast_to(normal, (count, 3)).astype(float),
        power=np.full((count, 3), power),
        lobe=np.full(count, lobe),
        gloss=np.full(count, -1.0),
        incident=np.zeros((count, 3)),
        patch=nowhere,
        mirror=nowhere - 1,
        generation=nowhere,
        path=np.arange(count, dtype=np.int64),
        paths=count,
    )


def spread(of: Room, count: int, seed: int = 1) -> tuple[Points, IntArray]:
    """Points (n, 3) anywhere on fronts, as many to each area, and their patches (n,)."""
    random, s = np.random.default_rng(seed), of.surfaces
    patch = random.choice(s.patch_count, count, p=s.area / s.area.sum()).astype(np.int32)
    corners = s.corners[patch]
    halves = np.stack([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]], axis=1)
    doubled = np.cross(halves[:, :, 1] - halves[:, :, 0], halves[:, :, 2] - halves[:, :, 0])
    area = np.linalg.norm(doubled, axis=2)
    second = (random.random(count) * area.sum(axis=1) > area[:, 0]).astype(int)
    share = random.dirichlet(np.ones(3), count)
    return np.einsum("nk,nka->na", share, halves[np.arange(count), second]), patch


def gains(
    of: Room,
    lights: VirtualLights,
    positions: Points,
    patch: IntArray,
    resolution: int = RESOLUTION,
    bound: float = np.inf,
) -> FloatArray:
    """Irradiance (m, n) W/m2, in the first channel, by each light alone at points (n, 3) of patches (n,)."""
    polygons = Polygons.of(of.surfaces)
    shining = shining_of(polygons, lights)
    sights = look_around(of.rays, polygons, shining.frames, resolution)
    receivers = Receivers.on(polygons, positions, patch)
    found = np.zeros((len(lights), 3, len(patch)), dtype=np.float32)
    for k in range(len(lights)):
        add_light(found[k], receivers, shining.part(k, k + 1), sights.part(k, k + 1), bound)
    return found[:, 0].astype(np.float64)


def true_gains(of: Room, lights: VirtualLights, positions: Points, patch: IntArray) -> FloatArray:
    """The same by a ray for each light and point."""
    normals = of.surfaces.normal[patch]
    each = [lights.take(np.array([k])) for k in range(len(lights))]
    return np.array([irradiance_of(light, positions, normals, of)[:, 0] for light in each])


def shining_of(polygons: Polygons, lights: VirtualLights) -> ShiningLights:
    """Lights as the kernel takes them."""
    return ShiningLights.of(polygons, lights.position, lights.normal, lights.power, lights.lobe)


def patch_at(of: Room, point: Sequence[float], normal: Sequence[float]) -> int:
    """The patch with that normal whose plane the point lies on."""
    s = of.surfaces
    height = np.einsum("pa,pa->p", np.asarray(point) - s.corners[:, 0], s.normal)
    (found,) = np.flatnonzero((np.abs(height) < 1e-9 * s.size) & (s.normal @ np.asarray(normal) > 0.999))
    return int(found)
