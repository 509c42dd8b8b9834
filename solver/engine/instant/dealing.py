"""Lights dealt out among the points of a pixel: each light shines on one of them, as many times as strong.

Where pixels show one plane that is as good as all lights on all points, and no dearer than one point. Where
they show an edge it is noise, which is little if every point has its share of the light of every block, and
the shares are alike in the long run.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from solver.engine.instant.blocks import LightBlock
from solver.types import LUMINANCE_WEIGHTS, Float32Array


class Dealer:
    """Deals the lights of blocks to the samples of a frame."""

    def __init__(self, samples: int) -> None:
        self._dealt = np.zeros(samples)
        """(samples,) luminous power that each has had so far, times paths"""

    def deal(self, block: LightBlock, batch: int) -> Iterator[tuple[int, Float32Array]]:
        """Samples in turn, and the factors (m,) by which a batch's m lights shine on each of them.

        Batches are cut into as many groups as it takes for all samples to have a part of the block.
        """
        samples = len(self._dealt)
        power = block.batch(batch).power @ LUMINANCE_WEIGHTS
        whole = float((block.lights.power @ LUMINANCE_WEIGHTS).sum())
        groups = min(-(-samples // len(block.sights)), len(power))
        for group in range(groups):
            chosen = slice(group, None, groups)
            factor = np.zeros(len(power), dtype=np.float32)
            factor[chosen] = samples
            # Who has had least.
            sample = int(np.argmin(self._dealt))
            self._dealt[sample] += block.paths * float(power[chosen].sum()) / max(whole, 1e-300)
            yield sample, factor
