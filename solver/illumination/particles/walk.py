"""The quasi-random walk: blocks of paths from the emitters on, each a complete estimate ([K 3.2, 4.1, 4.3]).

N paths begin on emitters. With the mean reflectivity rho, the first floor(rho N) of them make a first
reflection, the first floor(rho^2 N) a second one, and so on; each is attenuated by what reflects it, and
those of the j-th together are divided by floor(rho^j N), not by N. So generation j is a mean over its own
paths, and all lights are about alike in power. Every vertex but the last of a path is left by the Halton
numbers of its own pair of dimensions.

Where less than one path is left the paper stops, and loses about 1 / N of the light. Here the first path
goes on, and is absorbed at random by what it carries beside a light's mean power: where all is like the
mean, rho^j N of it is left. So a block is right in the mean, of however few paths it is, and none of its
lights outshines the others because a path went where reflectances are far from rho. There are M < N / (1 -
rho) lights: what the tail adds, in the mean, is less than rounding down has left free, where all is like the
mean.

Specular surfaces lengthen a path by a piece [K 4.2]: which reflection it goes on by is decided at random,
and after a specular one it goes on within its generation, up to the next diffuse one, as if nothing had
happened. What it leaves there covers light that reaches a diffuse surface by way of specular ones and is
reflected again. The last way, from a light by a specular surface to who asks, is another matter, and nothing
is counted twice: for planar mirrors it is that of `mirrors.mirrored_lights`; where a lobe is glossy, a
glossy light is left.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.geometry.surfaces import Surfaces
from solver.illumination.particles.emission import Emitters
from solver.illumination.particles.lights import VirtualLights, join
from solver.illumination.particles.path_numbers import PathNumbers, PathPoints
from solver.illumination.particles.walk_kernels import absorb, arrive, emit, leave, reflect
from solver.illumination.particles.walk_tables import Particles, Tables
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Int64Array
from solver.visibility.rays import RayScene

_NO_GLOSS: Final = -1.0
"""The gloss of lights that are not glossy."""


@dataclass(frozen=True)
class WalkSettings:
    """How paths are walked."""

    points: PathPoints = PathPoints.SCRAMBLED
    absorb_at_random: bool = False
    """Whether each path is absorbed at random, with probability 1 - rho a reflection [K 4.3]: paths then do
    not depend on each other, and one can be replaced. Weights are reflectance over rho: without bound, where
    light stays among surfaces much brighter than the mean."""
    seed: int = 0
    """>= 0"""


class ParticleWalk:
    """Walks in one scene."""

    def __init__(self, surfaces: Surfaces, rays: RayScene, settings: WalkSettings | None = None) -> None:
        self.settings = settings or WalkSettings()
        self.mean_reflectivity = mean_reflectivity(surfaces)
        """[K 3.2] rho, in [0, 1)"""
        self.rays = rays
        self.tables = Tables.of(surfaces, rays.offset / rays.scale)
        self.emitters = Emitters.of(surfaces)
        self.numbers = PathNumbers(self.settings.points, self.settings.seed)

    def block(self, first: int, count: int, among: int | None = None) -> VirtualLights:
        """The lights of the paths [first, first + count): an estimate of all light that leaves surfaces.

        Blocks of different paths may be joined (`lights.join_blocks`), and none is lost when more are added.
        With `absorb_at_random` a block may be a part of an estimate of `among` paths, down to one path.
        Raises ValueError for indices that have no Halton point, and for parts without that setting.
        """
        work = self.block_in_steps(first, count, among)
        while True:
            try:
                next(work)
            except StopIteration as end:
                lights: VirtualLights = end.value
                return lights

    def block_in_steps(
        self, first: int, count: int, among: int | None = None
    ) -> Generator[None, None, VirtualLights]:
        """As `block`; yields after every reflection; where surfaces are white there are thousands."""
        paths = count if among is None else among
        if not 1 <= count <= paths:
            raise ValueError(f"a block has 1 path at least and its estimate at most, not {count} of {paths}")
        if count < paths and not self.settings.absorb_at_random:
            raise ValueError("paths depend on each other unless they are absorbed at random")
        return (yield from _Block(self, first, count, paths).lights())


def mean_reflectivity(surfaces: Surfaces) -> float:
    """[K 3.2] rho: the share of light that makes another diffuse reflection, from means over the area.

    It is diffuse reflectance, in luminance; what is reflected specularly instead is on its way to another
    one, and glossy lights, too, want paths that leave them.
    """
    total = float(surfaces.area.sum())
    if total == 0.0:
        return 0.0

    def mean(albedo: FloatArray) -> float:
        return float(surfaces.area @ (albedo @ LUMINANCE_WEIGHTS)) / total

    diffuse, specular = mean(surfaces.reflectance), mean(surfaces.specular)
    glossy = mean(np.where(np.isinf(surfaces.exponent)[:, None], 0.0, surfaces.specular))
    return max(diffuse / (1.0 - specular) if specular < 1.0 else 0.0, glossy)


class _Block:
    """One block on its way."""

    def __init__(self, walk: ParticleWalk, first: int, count: int, paths: int) -> None:
        self._walk = walk
        self._seed = walk.settings.seed
        self._first = first
        self._count = count
        self._paths = paths
        self._particles = Particles.allocate(count)

    def lights(self) -> Generator[None, None, VirtualLights]:
        """Walk all paths to their ends; yields after every reflection."""
        walk, rows = self._walk, self._begin()
        parts = [self._leave_lights(rows, 0, self._paths)]
        generation, expected = 0, float(self._paths)
        while True:
            generation += 1
            expected *= walk.mean_reflectivity
            rows, share = self._going_on(rows, generation, expected)
            if len(rows) == 0:
                return join(parts, self._paths)
            spread = 1.0 / max(1, math.ceil(expected))
            numbers = walk.numbers.pairs(self._first, rows, 2 * generation, spread)
            leave(rows, numbers, walk.tables, self._particles)
            rows, glossy = self._reflected(rows, generation, share)
            if expected < 1.0 and not walk.settings.absorb_at_random:
                rows = self._absorbed(rows, generation, self._worth(rows))
            parts += [*glossy, self._leave_lights(rows, generation, share)]
            yield

    def _begin(self) -> Int64Array:
        """Place particles on emitters, if there are any, and tell which there are."""
        emitters = self._walk.emitters
        rows: Int64Array = np.arange(self._count if len(emitters.patch) > 0 else 0, dtype=np.int64)
        numbers = self._walk.numbers.pairs(self._first, rows, 0, 1.0 / self._paths)
        emit(numbers, emitters.patch, emitters.cumulative, emitters.power, self._walk.tables, self._particles)
        return rows

    def _going_on(self, rows: Int64Array, generation: int, expected: float) -> tuple[Int64Array, int]:
        """The paths that go on to a generation that `expected` ones are to reach, and how many share it."""
        walk = self._walk
        if walk.settings.absorb_at_random:
            return self._absorbed(rows, generation, np.full(len(rows), walk.mean_reflectivity)), self._paths
        if walk.mean_reflectivity == 0.0:
            return rows[:0], 1
        share = max(1, int(expected))
        return rows[rows < share], share

    def _worth(self, rows: Int64Array) -> FloatArray:
        """What paths (n,) carry beside a light's mean power, in the channel where that is most; at most 1."""
        emitted = self._walk.emitters.emitted
        mean = np.where(emitted > 0.0, emitted, np.inf) / self._paths
        return np.asarray(np.minimum((self._particles.carried[rows] / mean).max(axis=1), 1.0))

    def _absorbed(self, rows: Int64Array, generation: int, survival: FloatArray) -> Int64Array:
        kept = np.empty_like(rows)
        count = absorb(rows, survival, self._seed, self._first, generation, self._particles, kept)
        return kept[:count]

    def _reflected(
        self, rows: Int64Array, generation: int, share: int
    ) -> tuple[Int64Array, list[VirtualLights]]:
        """Trace rays to the next diffuse reflection: the paths that make it, and glossy lights on the way."""
        walk, particles = self._walk, self._particles
        matt: list[Int64Array] = []
        glossy: list[VirtualLights] = []
        piece = 0
        while len(rows) > 0:
            hits = walk.rays.intersect(particles.origin[rows], particles.direction[rows])
            diffuse, specular = np.empty_like(rows), np.empty_like(rows)
            ends = arrive(
                rows, hits.triangle, hits.distance, self._seed, self._first, generation, piece,
                walk.tables, particles, diffuse, specular,
            )  # fmt: skip
            matt.append(diffuse[: ends[0]])
            specular = specular[: ends[1]]
            gloss = walk.tables.exponent[particles.patch[specular]]
            lobed = np.isfinite(gloss)
            if lobed.any():
                glossy.append(self._leave_lights(specular[lobed], generation, share, gloss[lobed]))
            rows = np.empty_like(specular)
            count = reflect(
                specular, self._seed, self._first, generation, piece, walk.tables, particles, rows
            )
            rows = rows[:count]
            piece += 1
        return np.sort(np.concatenate(matt)), glossy

    def _leave_lights(
        self, rows: Int64Array, generation: int, share: int, gloss: FloatArray | None = None
    ) -> VirtualLights:
        """Lights where the particles `rows` are, each one of `share` that are a mean together."""
        particles, count = self._particles, len(rows)
        return VirtualLights(
            position=particles.position[rows],
            normal=particles.normal[rows],
            power=particles.carried[rows] / share,
            lobe=particles.lobe[rows],
            gloss=np.full(count, _NO_GLOSS) if gloss is None else gloss,
            incident=particles.incident[rows],
            patch=particles.patch[rows],
            mirror=np.full(count, -1, dtype=np.int32),
            generation=np.full(count, generation, dtype=np.int32),
            path=self._first + rows,
            paths=self._paths,
        )
