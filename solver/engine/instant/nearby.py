"""What short rays come upon, lit by the lights of a block: for pixels and texels alike."""

from __future__ import annotations

from typing import Final

import numpy as np

from solver.engine.instant.blocks import LightBlock, LightBlocks
from solver.illumination.particles.compensation import Known, NearbyLight
from solver.illumination.particles.glossy import GlossyLight
from solver.illumination.particles.light_lobes import Gloss
from solver.illumination.particles.receivers import Receivers
from solver.kernels import kernel
from solver.types import Float32Array, Int64Array, IntArray

PATHS_PER_RAY: Final = 32
"""Paths of a block for each ray that a point sends to what is near."""

HELPERS: Final = 4
"""Batches of lights that light up what such rays meet."""


def nearby_light(
    blocks: LightBlocks,
    block: LightBlock,
    bound: float,
    reach_bound: float,
    known: Known | None,
    helpers: int = HELPERS,
    sample: tuple[int, int] = (0, 1),
) -> NearbyLight:
    """Puts back what the lights of `block`, bounded by `bound`, leave out within the reach of `reach_bound`.

    Where rays end `helpers` batches of lights shine, others each time, so that in the mean all of them do. Of
    a pixel's samples each has others too: `sample` is its number, and how many there are.
    """
    world, polygons = blocks.world, blocks.polygons
    surfaces = world.surfaces
    helper = blocks.kept(block)
    batches = len(helper.sights)

    def polish(receivers: Receivers, gloss: Gloss | None, turn: int) -> Float32Array:
        light = np.zeros((3, len(receivers)), dtype=np.float32)
        for k in range(min(helpers, batches)):
            batch = ((turn * sample[1] + sample[0]) * helpers + k) % batches
            blocks.shine(light, receivers, helper, batch, bound, max(1.0, batches / helpers), gloss)
        return light

    def shine(receivers: Receivers, turn: int) -> Float32Array:
        return polish(receivers, None, turn)

    glossy = GlossyLight(surfaces, polygons, world.rays, polish) if surfaces.has_specular else None
    bounds = (block.emission_bound, helper.emission_bound)
    return NearbyLight(surfaces, polygons, world.rays, reach_bound, shine, known, glossy, bounds)


def shared_rays(patch: IntArray, every: int, turn: int) -> tuple[Int64Array, IntArray]:
    """Where runs of up to `every` neighbours on one patch (n,) begin (k + 1,), and who sends its ray (k,).

    Neighbours in a list of points are near each other. Without runs one in `every` points would be that many
    times as bright, and the others too dark, until all have had their turn.
    """
    start, asked = np.empty(len(patch) + 1, dtype=np.int64), np.empty(len(patch), dtype=np.int32)
    runs = _run(patch, every, turn, start, asked)
    return start[: runs + 1], asked[:runs]


@kernel
def _run(patch: IntArray, every: int, turn: int, start: Int64Array, asked: IntArray) -> int:
    """Number of runs, where they begin, and who of them is asked."""
    runs, n = 0, len(patch)
    start[0] = 0
    for i in range(1, n + 1):
        if i == n or i % every == 0 or patch[i] != patch[i - 1]:
            first = start[runs]
            asked[runs] = first + turn % (i - first)
            runs += 1
            start[runs] = i
    return runs
