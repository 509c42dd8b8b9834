"""Virtual lights behind mirrors ([K 4.2], after Diefenbach and Badler 1995).

A light that faces a planar mirror shines a second time: from its image behind the mirror, through the
mirror, on what is in front of it. The paper makes an image only where a path happens to hit a mirror; then
it stands for light that goes all the same way, and is right in the mean only if it is divided by the
probability of that hit, the form factor of mirror and light, which is small for the images that matter
least. Here each light has its image in every mirror that it faces. Those are all that there are, they cost
no ray, and they weigh what the mirror reflects. Paths that hit mirrors go on (see `walk`), but leave nothing
at them.

Light that meets several mirrors one after the other last of all comes from an image of an image, and these
are made as well, to a depth. Glossy surfaces have no images; walks leave glossy lights at them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver import tolerances
from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.lights import VirtualLights, join
from solver.types import LUMINANCE_WEIGHTS, BoolArray, Corners, FloatArray, Int64Array, IntArray, Points

DEEPEST: Final = 4
"""Mirrors in a row that an image is seen in, at most."""

SLIGHTEST: Final = 1.0 / 16.0
"""Images that send less than this times the mean power of a light are left out at random."""

_MIRRORS: Final = 256
"""Mirrors that are asked at once: bounds what is held of all lights by all mirrors."""


def mirrors_of(surfaces: Surfaces) -> Int64Array:
    """The patches (k,) that are perfect mirrors."""
    return np.flatnonzero(np.isinf(surfaces.exponent) & surfaces.specular.any(axis=1))


@dataclass(frozen=True, eq=False)
class Images:
    """k images of lights, those of lights proper first, and images of images after what they show."""

    lights: VirtualLights
    """(k)"""
    source: Int64Array
    """(k,) the light proper that is shown in the end"""
    parent: Int64Array
    """(k,) the image that is shown, before this one in the list; -1 for the light proper"""


def mirrored_lights(
    lights: VirtualLights, surfaces: Surfaces, most: int | None = None, seed: int = 0
) -> VirtualLights:
    """The images of `lights`, none of which is an image, in all mirrors that they face.

    Of more than `most` images so many are chosen at random, about by the light that they send through their
    mirror, and made as much stronger as they had been likely to be left out: what they add up to is right in
    the mean. Raises ValueError for lights that are images.
    """
    return mirror_images(lights, surfaces, most, seed, deepest=1, slightest=0.0).lights


def mirror_images(
    lights: VirtualLights,
    surfaces: Surfaces,
    most: int | None = None,
    seed: int = 0,
    deepest: int = DEEPEST,
    slightest: float = SLIGHTEST,
) -> Images:
    """As `mirrored_lights`, by up to `deepest` mirrors in a row.

    Images that send less than `slightest` of the mean power of a light are as many, in the mean, as if they
    had sent that much. Each depth has half as many images as the one before, at most: what mirrors show of
    mirrors becomes less.
    """
    if np.any(lights.mirror >= 0):
        raise ValueError("images have no images")
    mirrors = mirrors_of(surfaces)
    total = float((lights.power @ LUMINANCE_WEIGHTS).sum())
    least = slightest * total / max(1, len(lights))
    random = np.random.default_rng(seed)
    level, source = lights, np.arange(len(lights), dtype=np.int64)
    before, found = 0, 0
    images, sources, parents = [lights.take(source[:0])], [source[:0]], [source[:0]]
    for depth in range(deepest):
        shown, mirror = _pairs(level, surfaces, mirrors)
        if len(shown) == 0:
            break
        likely = _likely(level, surfaces, shown, mirror, least, None if most is None else most >> depth)
        chosen = _choose(likely, random)
        shown, mirror = shown[chosen], mirror[chosen]
        parents.append(shown + before if depth > 0 else np.full(len(shown), -1, dtype=np.int64))
        source = source[shown]
        level = _image(level.take(shown), surfaces, mirror, 1.0 / likely[chosen])
        images.append(level)
        sources.append(source)
        before, found = found, found + len(level)
    return Images(join(images, lights.paths), np.concatenate(sources), np.concatenate(parents))


def _pairs(level: VirtualLights, surfaces: Surfaces, mirrors: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Lights and the mirrors that have images of them."""
    parts = [
        _facing(level, surfaces, mirrors[start : start + _MIRRORS])
        for start in range(0, len(mirrors), _MIRRORS)
    ]
    none: Int64Array = np.empty(0, dtype=np.int64)
    shown = np.concatenate([none, *(part[0] for part in parts)])
    mirror = np.concatenate([none, *(part[1] for part in parts)])
    through = level.mirror[shown]
    if len(shown) == 0 or through[0] < 0:
        return shown, mirror
    # An image shines through its own mirror alone.
    met = _meets(level.position[shown], surfaces, through, mirror)
    return shown[met], mirror[met]


def _meets(eye: Points, surfaces: Surfaces, through: IntArray, mirror: Int64Array) -> BoolArray:
    """Whether mirrors (m,) may be seen from points (m, 3) behind others, through these; seldom wrongly so."""
    corners = surfaces.corners[mirror] - eye[:, None]
    window = surfaces.corners[through] - eye[:, None]
    level = np.einsum("mca,ma->mc", corners - window[:, :1], surfaces.normal[through])
    met = (through != mirror) & (level > tolerances.SIDE * surfaces.size).any(axis=1)
    for k in range(4):
        edge = np.cross(window[:, k], window[:, (k + 1) % 4])
        inside = np.einsum("mca,ma->mc", corners, edge)
        degenerate = ~edge.any(axis=1)
        met &= degenerate | (inside > 0.0).any(axis=1)
    return np.asarray(met)


def _likely(
    level: VirtualLights,
    surfaces: Surfaces,
    shown: Int64Array,
    mirror: Int64Array,
    least: float,
    most: int | None,
) -> FloatArray:
    """How likely (m,) images are chosen, by what they send, of which `least` W are sure; `most` in sum."""
    sent = np.einsum("mc,mc,c->m", level.power[shown], surfaces.specular[mirror], LUMINANCE_WEIGHTS)
    sent *= _solid_angle(surfaces.corners[mirror] - level.position[shown, None]) / np.pi
    likely = np.minimum(sent / least, 1.0) if least > 0.0 else np.ones(len(shown))
    if most is None or likely.sum() <= most:
        return np.asarray(likely)
    return _likelihoods(sent, most)


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
