"""Small radiosity fields made by hand: patches split into quadtrees where a rule says so."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.transport.field import RadiosityField
from solver.types import FloatArray, Points

Split = Callable[[FloatArray, int], bool]
"""Whether to split a leaf, by its corners (3 or 4, 3) and its depth."""

Function = Callable[[Points], FloatArray]
"""Irradiance (n, 3) at points (n, 3)."""


def even(depth: int) -> Split:
    """Split all leaves `depth` times."""
    return lambda corners, level: level < depth


def uneven(seed: int, depth: int, chance: float = 0.5) -> Split:
    """Split leaves by chance, at least once and at most `depth` times."""
    random = np.random.default_rng(seed)
    return lambda corners, level: level < depth and (level < 1 or bool(random.random() < chance))


def towards(point: tuple[float, float, float], depth: int) -> Split:
    """Split the leaves nearest to `point` down to `depth`, the others hardly: neighbours of many levels."""

    def rule(corners: FloatArray, level: int) -> bool:
        nearest = np.clip(point, corners.min(axis=0), corners.max(axis=0))
        return level < depth and bool(np.linalg.norm(nearest - point) < 1e-9 * (1 + np.abs(point).max()))

    return rule


def split_leaf(corners: FloatArray) -> list[FloatArray]:
    """The four children of a leaf."""
    n = len(corners)
    middle = 0.5 * (corners + np.roll(corners, -1, axis=0))
    if n == 3:
        tips = [np.array([corners[k], middle[k], middle[k - 1]]) for k in range(3)]
        return [*tips, middle]
    center = 0.5 * (middle[0] + middle[2])
    return [np.roll(np.array([corners[k], middle[k], center, middle[k - 1]]), k, axis=0) for k in range(4)]


def constant(value: float = 1.0) -> Function:
    """The same irradiance everywhere."""
    return lambda points: np.full((len(points), 3), value)


def linear(gradient: tuple[float, float, float], at_origin: float) -> Function:
    """A linear field; its channels differ by factors."""
    factors = np.array([1.0, 0.5, 2.0])
    return lambda points: (at_origin + points @ np.array(gradient))[:, None] * factors


def build_field(surfaces: Surfaces, split: Split, irradiance: Function | None = None) -> RadiosityField:
    """A field over `surfaces`; leaf means are `irradiance` at centroids, right for linear fields."""
    corners: list[FloatArray] = []
    patches: list[int] = []
    for patch in range(surfaces.patch_count):
        waiting = [(surfaces.corners[patch, : surfaces.corner_count[patch]], 0)]
        while waiting:
            leaf, level = waiting.pop()
            if split(leaf, level):
                waiting.extend((child, level + 1) for child in split_leaf(leaf))
            else:
                corners.append(leaf)
                patches.append(patch)
    count = np.array([len(leaf) for leaf in corners], dtype=np.int32)
    padded = np.array([leaf[[0, 1, 2, -1]] for leaf in corners])
    first, second = (np.cross(padded[:, k] - padded[:, 0], padded[:, k + 1] - padded[:, 0]) for k in (1, 2))
    areas = 0.5 * np.stack([np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)])
    centroids = (padded[:, 0] + padded[:, 2])[None] + np.stack([padded[:, 1], padded[:, 3]])
    area = areas.sum(axis=0)
    centroid = np.einsum("kn,kni->ni", areas / area, centroids / 3.0)
    patch_of = np.array(patches, dtype=np.int32)
    h = (irradiance or constant())(centroid)
    return RadiosityField(
        corners=padded,
        corner_count=count,
        patch=patch_of,
        area=area,
        radiosity=surfaces.emission[patch_of] + surfaces.reflectance[patch_of] * h,
        irradiance=h,
    )


def polygons(
    *faces: list[tuple[float, float, float]],
    name: str = "thing",
    reflectance: float = 0.5,
    emission: float = 0.0,
    two_sided: bool = False,
) -> SceneObject:
    """An object of polygons that share no vertices."""
    vertices = np.array([vertex for face in faces for vertex in face], dtype=np.float64)
    ends = np.cumsum([len(face) for face in faces])
    indices = tuple(tuple(range(end - len(face), end)) for face, end in zip(faces, ends, strict=True))
    material = Material(np.full(3, reflectance), np.full(3, emission), two_sided)
    return SceneObject(name, Mesh(vertices, indices), material)


def surfaces_of(*objects: SceneObject) -> Surfaces:
    """Surfaces of a scene of these objects."""
    return flatten(Scene({thing.id: thing for thing in objects}))


def camera(
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    size: tuple[int, int] = (80, 60),
    up: tuple[float, float, float] = (0.0, 0.0, 1.0),
    fov: float = 50.0,
) -> Camera:
    """A camera."""
    return Camera(np.array(eye), np.array(target), np.array(up), fov, *size)


SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
"""The unit square, seen from above."""
