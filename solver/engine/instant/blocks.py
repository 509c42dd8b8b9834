"""Virtual lights, block by block, walked once, and what they see, traced once for all cameras.

Blocks are complete estimates, the first ones small, so that a frame has all light after some milliseconds;
those after them double the number of paths each time. What lights see is kept for as many as memory is set
aside for; others look around again whenever they are needed.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

import numpy as np

from solver.engine.instant.earlier import EarlierSights
from solver.engine.world import World
from solver.illumination.particles.clearance import clear_of_walls
from solver.illumination.particles.compensation import emission_bounds
from solver.illumination.particles.images import FoldedLights, ShiningImages, look_through
from solver.illumination.particles.light_lobes import Gloss
from solver.illumination.particles.lighting import ShiningLights, add_light
from solver.illumination.particles.mirrors import mirror_images
from solver.illumination.particles.receivers import Polygons, Receivers
from solver.illumination.particles.sights import Sights, look_around
from solver.illumination.particles.thinning import PATHS, thinned
from solver.illumination.particles.walk import ParticleWalk
from solver.transport.pace import finish
from solver.types import Float32Array, FloatArray

FIRST: Final = 8
"""Paths of a first block."""

RING: Final = 8
"""Number of first blocks: K keeps the images of as many paths as they have, and replaces the oldest."""

MOST: Final = 1024
"""Paths of a block, at most."""

BATCH: Final = 16
"""Lights that are lit with at once."""

MOST_WALKED: Final = 1 << 19
"""Reflections of all paths that are walked at once, about: bounds memory where surfaces are white."""

SIGHT_BYTES: Final = 256 * 2**20
"""Memory for what lights see, of one session."""


def block_paths(number: int) -> int:
    """How many paths the block `number` has."""
    if number < RING:
        return FIRST
    return int(min(FIRST * RING * 2 ** (number - RING), MOST))


def first_path(number: int) -> int:
    """Paths in all blocks before `number`."""
    if number < RING:
        return FIRST * number
    return sum(block_paths(k) for k in range(number))


class LightBlock:
    """The lights of one block, in an order that has nothing to do with where they are, and their images."""

    def __init__(
        self,
        number: int,
        paths: int,
        lights: ShiningLights,
        images: ShiningImages,
        emission_bound: FloatArray,
    ) -> None:
        self.number = number
        self.paths = paths
        self.emission_bound = emission_bound
        """(p,) local: what patches emit is not bounded by less"""
        self.lights = lights
        self.images = images
        self.sights: list[Sights | None] = [None] * -(-len(lights) // BATCH)
        self.folded: list[FoldedLights | None] = [None] * len(self.sights)
        """Of batches whose sights are kept and whose lights have images"""

    @property
    def is_kept(self) -> bool:
        """Whether what all of its lights see is in memory."""
        return all(sights is not None for sights in self.sights)

    def batch(self, number: int) -> ShiningLights:
        """Some of its lights."""
        return self.lights.part(number * BATCH, (number + 1) * BATCH)


class LightBlocks:
    """All blocks of one world, made as they are asked for."""

    def __init__(
        self, world: World, resolution: int, seed: int = 0, before: LightBlocks | None = None
    ) -> None:
        """None are made yet. What lights saw of an earlier world, by the blocks `before`, is seen again."""
        self.world = world
        self.polygons = Polygons.of(world.surfaces)
        self._walk = ParticleWalk(world.surfaces, world.rays)
        self._resolution = resolution
        self._seed = seed
        self._blocks: dict[int, LightBlock] = {}
        self._before = (
            None if before is None else EarlierSights(before.seen(), before.polygons, self.polygons)
        )
        self._bytes = 0
        self.light_count = 0
        """Lights made so far"""

    def block(self, number: int) -> LightBlock:
        """The block `number`, which is walked if it is new."""
        return finish(self.block_in_steps(number))

    def block_in_steps(self, number: int) -> Generator[None, None, LightBlock]:
        """As `block`; yields every few milliseconds."""
        if number not in self._blocks:
            paths = block_paths(number)
            surfaces = self.world.surfaces
            room = MOST_WALKED * (1.0 - self._walk.mean_reflectivity)
            each = max(1, min(PATHS, int(room / paths)))
            walked = yield from self._walk.block_in_steps(PATHS * first_path(number), each * paths)
            yield
            lights = thinned(walked, surfaces, paths, self._seed)
            order = np.random.default_rng((self._seed, number)).permutation(len(lights)).astype(np.int32)
            lights = clear_of_walls(lights.take(order), surfaces)
            least = emission_bounds(surfaces, paths)
            shining = ShiningLights.all_of(self.polygons, lights, least)
            images = mirror_images(lights, surfaces, len(lights), number)
            self._blocks[number] = LightBlock(
                number, paths, shining, ShiningImages.of(self.polygons, shining, images, least), least
            )
            self.light_count += len(shining)
        return self._blocks[number]

    def kept(self, block: LightBlock) -> LightBlock:
        """`block`, or the largest one of which all is in memory."""
        if block.is_kept:
            return block
        kept = [other for other in self._blocks.values() if other.is_kept]
        return max(kept, key=lambda other: other.paths, default=block)

    def sights(self, block: LightBlock, batch: int) -> Sights:
        """What the lights of a batch see."""
        return self._look(block, batch)[0]

    def shine(
        self,
        light: Float32Array,
        receivers: Receivers,
        block: LightBlock,
        batch: int,
        bound: float,
        factor: float | Float32Array = 1.0,
        gloss: Gloss | None = None,
    ) -> None:
        """Add to `light` (3, n) W/m2 what a batch and its images give, `factor` times as strong.

        With an array (m,) each light has a factor of its own, and so have its images. `bound` and `gloss`
        are those of `add_light`.
        """
        sights, folded = self._look(block, batch)
        add_light(light, receivers, block.batch(batch).scaled(factor), sights, bound, None, gloss)
        if folded is not None:
            images = folded.scaled(factor)
            add_light(light, receivers, images.lights, images.sights, bound, images.folds, gloss)

    def seen(self) -> dict[int, list[tuple[ShiningLights, Sights]]]:
        """What lights see, as far as it is kept, batch by batch for the blocks by their numbers."""
        return {
            number: [(block.batch(k), sights) for k, sights in enumerate(block.sights) if sights is not None]
            for number, block in self._blocks.items()
        }

    def _look(self, block: LightBlock, batch: int) -> tuple[Sights, FoldedLights | None]:
        """What the lights of a batch see, and their images."""
        kept = block.sights[batch]
        if kept is not None:
            return kept, block.folded[batch]
        lights = block.batch(batch)
        rays, polygons = self.world.rays, self.polygons
        known = None if self._before is None else self._before.of(block.number, lights)
        sights = look_around(rays, polygons, lights.frames, self._resolution, known)
        images = block.images.part(batch * BATCH, (batch + 1) * BATCH)
        folded = look_through(rays, polygons, lights, sights, images) if len(images) > 0 else None
        taken = sights.nbytes
        if folded is not None:
            # Both have the maps of the lights: once is enough.
            sights, taken = folded.sights.part(0, len(lights)), folded.nbytes
        if self._bytes + taken <= SIGHT_BYTES:
            self._bytes += taken
            block.sights[batch], block.folded[batch] = sights, folded
        if self._before is not None and block.is_kept:
            self._before.forget(block.number)
        return sights, folded
