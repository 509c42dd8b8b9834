"""What lights saw before an edit, seen again: the same maps as anew, for a few of the rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.instant.blocks import LightBlocks
from solver.engine.world import World
from solver.geometry.scene import Scene
from solver.visibility.rays import RayScene
from tests.redistribution.rooms import crate, placed, room

BLOCK = 8
RESOLUTION = 24


def looked(blocks: LightBlocks) -> LightBlocks:
    """With the maps of all lights of a block."""
    block = blocks.block(BLOCK)
    for batch in range(len(block.sights)):
        blocks.sights(block, batch)
    return blocks


def furnished() -> Scene:
    return room().with_object(crate("a", (2.6, 1.9, 0.0), 0.3)).with_object(crate("b", (1.0, 1.2, 0.0)))


def moved(scene: Scene) -> Scene:
    return scene.with_replaced(replace(scene.object("a"), transform=placed((2.4, 1.7, 0.2))))


@pytest.mark.parametrize(
    "after",
    [
        moved(furnished()),
        furnished().without_object("a"),
        furnished().with_object(crate("c", (0.5, 2.0, 0.4))),
    ],
    ids=["moved", "removed", "added"],
)
def test_maps_are_those_of_lights_that_look_around_anew(
    after: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = looked(LightBlocks(World.of(furnished()), RESOLUTION))
    world, rays = World.of(after), 0
    ask = RayScene.first_local

    def counted(self: RayScene, origins: np.ndarray, *others: object) -> object:
        nonlocal rays
        rays += len(origins)
        return ask(self, origins, *others)  # type: ignore[arg-type]

    again, anew = LightBlocks(world, RESOLUTION, before=before), LightBlocks(world, RESOLUTION)
    for blocks in (again, anew):
        blocks.block(BLOCK)
    monkeypatch.setattr(RayScene, "first_local", counted)
    looked(again)
    spent, rays = rays, 0
    looked(anew)
    assert spent < 0.85 * rays
    for mine, theirs in zip(again.block(BLOCK).sights, anew.block(BLOCK).sights, strict=True):
        assert mine is not None
        assert theirs is not None
        seen, expected = (
            sights.polygon[sights.start[:-1, None, None] + sights.texels] for sights in (mine, theirs)
        )
        np.testing.assert_array_equal(seen, expected)
        np.testing.assert_array_equal(mine.cone[mine.start[:-1]], theirs.cone[theirs.start[:-1]])


def test_earlier_maps_are_let_go() -> None:
    before = looked(LightBlocks(World.of(furnished()), RESOLUTION))
    again = looked(LightBlocks(World.of(moved(furnished())), RESOLUTION, before=before))
    assert again._before is not None
    assert again._before._seen == {}
    assert again._before._joined == {}
