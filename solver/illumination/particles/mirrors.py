"""Virtual lights behind mirrors ([K 4.2], after Diefenbach and Badler 1995).

A light that faces a planar mirror shines a second time: from its image behind the mirror, through the
mirror, on what is in front of it. The paper makes an image only where a path happens to hit a mirror; then
it stands for light that goes all the same way, and is right in the mean only if it is divided by the
probability of that hit, the form factor of mirror and light, which is small for the images that matter
least. Here each light has its image in every mirror that it faces. Those are all that there are, they cost
no ray, and they weigh what the mirror reflects. Paths that hit mirrors go on (see `walk`), but leave nothing
at them.

What is left out is light that meets two mirrors one after the other last of all, before it gets to who asks:
an image of an image. Glossy surfaces have no images; walks leave glossy lights at them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.lights import VirtualLights
from solver.types import LUMINANCE_WEIGHTS, BoolArray, Corners, FloatArray, Int64Array, Points

_MIRRORS: Final = 256
"""Mirrors that are asked at once: bounds what is held of all lights by all mirrors."""


def mirrors_of(surfaces: Surfaces) -> Int64Array:
    """The patches (k,) that are perfect mirrors."""
    return np.flatnonzero(np.isinf(surfaces.exponent) & surfaces.specular.any(axis=1))


def mirrored_lights(
    lights: VirtualLights, surfaces: Surfaces, most: int | None = None, seed: int = 0
) -> VirtualLights:
    """The images of `lights`, none of which is an image, in all mirrors that they face.

    Of more than `most` images so many are chosen at random, about by the light that they send through their
    mirror, and made as much stronger as they had been likely to be left out: what they add up to is right in
    the mean. Raises ValueError for lights that are images.
    """
    if np.any(lights.mirror >= 0):
        raise ValueError("images have no images")
    mirrors = mirrors_of(surfaces)
    parts = [
        _facing(lights, surfaces, mirrors[start : start + _MIRRORS])
        for start in range(0, len(mirrors), _MIRRORS)
    ]
    none: Int64Array = np.empty(0, dtype=np.int64)
    light = np.concatenate([none, *(part[0] for part in parts)])
    mirror = np.concatenate([none, *(part[1] for part in parts)])
    factor = np.ones(len(light))
    if most is not None and len(light) > most:
        sent = np.einsum("mc,mc,c->m", lights.power[light], surfaces.specular[mirror], LUMINANCE_WEIGHTS)
        sent *= _solid_angle(surfaces.corners[mirror] - lights.position[light, None])
        likely = _likelihoods(sent, most)
        chosen = _choose(likely, np.random.default_rng(seed))
        light, mirror, factor = light[chosen], mirror[chosen], 1.0 / likely[chosen]
    return _image(lights.take(light), surfaces, mirror, factor)


def _facing(lights: VirtualLights, surfaces: Surfaces, mirrors: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Lights and mirrors, in pairs, that are before each other and neither black."""
    least = tolerances.SIDE * surfaces.size
    normal, corners = surfaces.normal[mirrors], surfaces.corners[mirrors]
    height = lights.position @ normal.T - np.einsum("ka,ka->k", normal, corners[:, 0])
    # The mirror is before a light if one of its corners is.
    level = np.einsum("ma,ma->m", lights.normal, lights.position)
    above = (np.einsum("ma,kna->mkn", lights.normal, corners) - level[:, None, None]).max(axis=2)
    shines = lights.power @ surfaces.specular[mirrors].T > 0.0
    light, mirror = np.nonzero((height > least) & (above > least) & shines)
    return light, mirrors[mirror]


def _image(
    lights: VirtualLights, surfaces: Surfaces, mirror: Int64Array, factor: FloatArray
) -> VirtualLights:
    """The images of lights (m,), one each, in mirrors (m,), `factor` (m,) times as strong."""
    normal = surfaces.normal[mirror]

    def reflected(vectors: FloatArray) -> FloatArray:
        return np.asarray(vectors - 2.0 * np.einsum("ma,ma->m", vectors, normal)[:, None] * normal)

    anchor = surfaces.corners[mirror, 0]
    return replace(
        lights,
        position=anchor + reflected(lights.position - anchor),
        normal=reflected(lights.normal),
        incident=reflected(lights.incident),
        power=lights.power * surfaces.specular[mirror] * factor[:, None],
        mirror=mirror.astype(np.int32),
    )


def _solid_angle(corners: Corners) -> FloatArray:
    """Solid angle (m,) of polygons (m, 4, 3) seen from the origin (van Oosterom and Strackee 1983)."""
    length = np.linalg.norm(corners, axis=2)
    a = corners[:, 0]
    angle = np.zeros(len(corners))
    for second in (1, 2):
        b, c = corners[:, second], corners[:, second + 1]
        triple = np.einsum("ma,ma->m", a, np.cross(b, c))
        la, lb, lc = length[:, 0], length[:, second], length[:, second + 1]
        below = la * lb * lc + lc * _dot(a, b) + la * _dot(b, c) + lb * _dot(c, a)
        angle += 2.0 * np.abs(np.arctan2(triple, below))
    return angle


def _dot(a: Points, b: Points) -> FloatArray:
    return np.asarray(np.einsum("ma,ma->m", a, b))


def _likelihoods(weights: FloatArray, most: int) -> FloatArray:
    """Probabilities (m,) in proportion to weights (m,) > 0, but at most 1, that add up to `most` < m."""
    falling = np.sort(weights)[::-1]
    # With the k largest at 1, the others share what is left; few enough are if the next stays below 1.
    rest = np.cumsum(falling[::-1])[::-1]
    certain = np.arange(len(weights))
    fits = (most - certain) * falling < rest
    k = int(np.argmax(fits))
    return np.asarray(np.minimum(1.0, (most - k) / rest[k] * weights))


def _choose(likely: FloatArray, random: np.random.Generator) -> BoolArray:
    """A choice (m,) by probabilities (m,), of as many as they add up to: where they sum up to an integer."""
    steps = np.floor(np.cumsum(likely) + random.random())
    return np.diff(steps, prepend=0.0) > 0.0
