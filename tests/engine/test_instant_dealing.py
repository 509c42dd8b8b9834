"""Lights dealt out among the points of a pixel."""

from __future__ import annotations

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.engine.instant.blocks import LightBlock, LightBlocks
from solver.engine.instant.dealing import Dealer
from solver.engine.world import World
from solver.types import LUMINANCE_WEIGHTS
from tests.engine.scenes import box


@pytest.fixture(scope="module", params=["box", "cornell"])
def blocks(request: pytest.FixtureRequest) -> list[LightBlock]:
    """Of 9 lights or so, and of 20."""
    made = LightBlocks(World.of(box() if request.param == "box" else load_sample("cornell")), 8)
    return [made.block(number) for number in range(11)]


def dealt(dealer: Dealer, block: LightBlock, samples: int) -> list[tuple[int, float]]:
    """Samples, and the part of a block's luminous power that each group of its lights has."""
    groups, whole = [], float((block.lights.power @ LUMINANCE_WEIGHTS).sum())
    for batch in range(len(block.sights)):
        power = block.batch(batch).power @ LUMINANCE_WEIGHTS
        total = np.zeros(len(power))
        for sample, factor in dealer.deal(block, batch):
            groups.append((sample, float(power @ factor) / samples / whole))
            total += factor
        np.testing.assert_array_equal(total, samples, "each light shines once, on one of so many")
    return groups


@pytest.mark.parametrize("samples", [1, 2, 3, 4, 16])
def test_all_points_have_had_as_much_but_for_a_group_of_lights(
    blocks: list[LightBlock], samples: int
) -> None:
    dealer = Dealer(samples)
    had, largest = np.zeros(samples), 0.0
    for block in blocks:
        groups = dealt(dealer, block, samples)
        some = {sample for sample, _ in groups}
        assert len(some) >= min(samples, len(block.lights)) // 2, "of each block as well"
        for sample, share in groups:
            had[sample] += block.paths * share
            largest = max(largest, block.paths * share)
        assert np.ptp(had) <= largest * (1.0 + 1e-6)


def test_one_point_has_all_lights_at_once(blocks: list[LightBlock]) -> None:
    dealer = Dealer(1)
    for block in blocks:
        for batch in range(len(block.sights)):
            ((sample, factor),) = dealer.deal(block, batch)
            assert sample == 0
            np.testing.assert_array_equal(factor, 1.0)
