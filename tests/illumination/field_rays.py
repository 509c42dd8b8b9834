"""Irradiance by rays into a solution's field: what point irradiance is of, without a form factor."""

from __future__ import annotations

import numpy as np

from solver.transport.solve import RadiositySolver
from solver.types import FloatArray, Int64Array, IntArray, Points, Spectra
from solver.visibility.rays import RayScene


def reflected_irradiance(
    solver: RadiositySolver, rays: RayScene, positions: Points, normals: FloatArray, per_side: int, seed: int
) -> Spectra:
    """(n, channels) of reflected light, by per_side^2 stratified rays from each point (n, 3)."""
    state, surfaces = solver.state, solver.surfaces
    random = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(per_side), np.arange(per_side)), axis=-1).reshape(-1, 2)
    out = np.empty((len(positions), state.channels))
    for k, (x, normal) in enumerate(zip(positions, normals, strict=True)):
        u, turn = ((grid + random.random(grid.shape)) / per_side).T
        flat = np.sqrt(u) * np.stack([np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn)])
        first = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
        first /= np.linalg.norm(first)
        frame = np.stack([first, np.cross(normal, first), normal])
        ways = np.stack([*flat, np.sqrt(1.0 - u)], axis=1) @ frame
        origins = np.tile(x + 2.0 * rays.offset * surfaces.size * normal, (len(ways), 1))
        hits = rays.intersect(origins, ways)
        patches = surfaces.triangle_patch[np.maximum(hits.triangle, 0)]
        is_front = np.einsum("na,na->n", surfaces.normal[patches[:, 0]], ways) < 0.0
        patch = np.where(is_front, patches[:, 0], patches[:, 1])
        lit = (hits.triangle >= 0) & (patch >= 0)
        patch, start, way = patch[lit], origins[lit], ways[lit]
        height = np.einsum("na,na->n", surfaces.normal[patch], surfaces.corners[patch, 0] - start)
        along = height / np.einsum("na,na->n", surfaces.normal[patch], way)
        places = start + along[:, None] * way
        out[k] = _reflected(solver, _leaf_at(solver, patch, places), places).sum(axis=0) / len(ways)
    return out


def _reflected(solver: RadiositySolver, leaf: Int64Array, places: Points) -> Spectra:
    state, tree = solver.state, solver.state.tree
    at = np.einsum("nka,na->nk", tree.axes[tree.patch[leaf]], places - tree.centroid[leaf])
    functions = state.radiosity[leaf]
    radiosity = functions[:, 0] + np.einsum("nk,nkc->nc", at, functions[:, 1:])
    return np.asarray(np.maximum(radiosity - state.emission[tree.patch[leaf]], 0.0))


def _leaf_at(solver: RadiositySolver, patch: IntArray, places: Points) -> Int64Array:
    """The leaf (n,) of each patch (n,) that a place on it is in."""
    tree = solver.state.tree
    element: Int64Array = patch.astype(np.int64)
    while True:
        inner = np.flatnonzero(tree.child[element] >= 0)
        if len(inner) == 0:
            return element
        parent, best = element[inner], np.full(len(inner), -np.inf)
        for k in range(4):
            child = np.where(k < tree.child_count[parent], tree.child[parent] + k, tree.child[parent])
            depth = _depth_within(solver, child, places[inner])
            element[inner] = np.where(depth > best, child, element[inner])
            best = np.maximum(best, depth)


def _depth_within(solver: RadiositySolver, element: Int64Array, places: Points) -> FloatArray:
    """Distance (n,) of places from the nearest side of elements, positive within."""
    tree = solver.state.tree
    corners = tree.corners[element]
    sides = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(sides, axis=2)
    inward = np.cross(tree.patch_normal[tree.patch[element]][:, None], sides)
    height = np.einsum("nka,nka->nk", inward, places[:, None] - corners)
    # A triangle's fourth side has no length.
    distance = np.where(length > 0.0, height / np.where(length > 0.0, length, 1.0), np.inf)
    return np.asarray(distance.min(axis=1))
