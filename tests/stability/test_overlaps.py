"""Polygons that run through each other, lie in one plane, or as near to it as makes no difference.

Right means: where two faces lie in one place, the light is that of a scene in which the one beneath has a
hole there; where they are apart, it tends to that; and no renderer shows them by turns.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import FrameRequest, LayerName, RendererName
from solver.geometry.scene import SceneObject
from tests.pathtracing.worlds import CUBE, INWARD, material, polygon
from tests.stability.chain import TOLERANCE, assert_sound, assert_traced, difference, irradiance, solve
from tests.stability.places import GREY, UP, X, Y, crate, grid, lamp, quad, room, scene

PALE = material(0.8)


def rug(height: float = 0.0, two_sided: bool = False, name: str = "rug", at: float = 0.25) -> SceneObject:
    """A quarter of the floor."""
    of = material(0.8, 0.0, two_sided)
    return quad(name, [at, at, height], 0.5 * X, 0.5 * Y, of)


def bare_room() -> list[SceneObject]:
    """The room with a hole in its floor, into which the rug fits."""
    walls = [polygon(f"wall{k}", CUBE[list(INWARD[k])], GREY) for k in range(1, 6)]
    strips = [
        quad("west", [0.0, 0.0, 0.0], 0.25 * X, Y, GREY),
        quad("east", [0.75, 0.0, 0.0], 0.25 * X, Y, GREY),
        quad("south", [0.25, 0.0, 0.0], 0.5 * X, 0.25 * Y, GREY),
        quad("north", [0.25, 0.75, 0.0], 0.5 * X, 0.25 * Y, GREY),
    ]
    return [*walls, *strips]


@pytest.fixture(scope="module")
def inlaid(drawing: Drawing) -> Engine:
    return solve(scene(*bare_room(), lamp(), rug()), drawing)


@pytest.mark.parametrize("two_sided", [False, True])
@pytest.mark.parametrize("height", [0.0, 1e-12, 1e-9, 1e-7, 1e-6])
def test_a_rug_on_the_floor_is_one_let_into_it(
    height: float, two_sided: bool, inlaid: Engine, drawing: Drawing
) -> None:
    engine = solve(scene(room(), lamp(), rug(height, two_sided)), drawing)
    assert_sound(engine, frames=height == 1e-7)
    at = grid(6) + height * UP
    assert difference(irradiance(engine, at, UP), irradiance(inlaid, at, UP)) < 0.5 * TOLERANCE
    ids = engine._world.surfaces.object_ids
    shown = engine.frame(FrameRequest(renderer=RendererName.FLAT, layer=LayerName.OBJECT)).image
    where = engine.frame(FrameRequest(renderer=RendererName.FLAT, layer=LayerName.POSITION)).image
    on_rug = np.all(np.abs(where[..., :2] - 0.5) < 0.24, axis=-1) & (np.abs(where[..., 2]) < 1e-3)
    assert on_rug.any() and np.all(shown[on_rug] == ids.index("rug")), "and nothing shines through"


@pytest.mark.parametrize("height", [1e-5, 1e-4, 1e-3])
def test_a_rug_above_the_floor_tends_to_one_on_it(height: float, inlaid: Engine, drawing: Drawing) -> None:
    engine = solve(scene(room(), lamp(), rug(height)), drawing)
    assert_sound(engine, frames=False)
    at = grid(6) + height * UP
    assert difference(irradiance(engine, at, UP), irradiance(inlaid, at, UP)) < TOLERANCE


def test_rugs_upon_each_other(drawing: Drawing) -> None:
    engine = solve(
        scene(room(), lamp(), rug(), rug(name="second", at=0.4), rug(name="third", at=0.1)), drawing
    )
    assert_sound(engine)
    assert_traced(engine, grid(5), UP)
    surfaces = engine._world.surfaces
    floor = (surfaces.normal[:, 2] > 0.99) & (np.abs(surfaces.corners[:, 0, 2]) < 1e-9)
    assert surfaces.area[floor].sum() == pytest.approx(1.0)


def test_lamps_upon_each_other_shine_once(drawing: Drawing) -> None:
    """What is hidden of the one does not emit."""
    second = replace(lamp(name="second"), mesh=quad("s", [0.5, 0.3, 0.9], 0.4 * Y, 0.4 * X, GREY).mesh)
    engine = solve(scene(room(), lamp(), second), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(5), UP)
    surfaces = engine._world.surfaces
    assert float(surfaces.area @ surfaces.emission[:, 0]) == pytest.approx(10.0 * 0.24)


@pytest.mark.parametrize("shift", [0.0, 1e-9, 1e-6, 0.1])
def test_boxes_that_run_through_each_other(shift: float, drawing: Drawing) -> None:
    one = crate("one", (0.2, 0.2, 0.1), (0.6, 0.6, 0.5))
    other = crate("other", (0.2 + shift, 0.4, 0.1 + shift), (0.8, 0.8, 0.5 + shift))
    engine = solve(scene(room(), lamp(), one, other), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(4), UP)


def test_sheets_that_cross(drawing: Drawing) -> None:
    both = material(0.5, 0.0, True)
    sheets = [
        polygon(
            f"{k}",
            np.array([[-0.3, 0, -0.2], [0.3, 0, -0.2], [0.3, 0, 0.2], [-0.3, 0, 0.2]]) @ turn + 0.5,
            both,
        )
        for k, turn in enumerate(turns(5))
    ]
    engine = solve(scene(room(), lamp(), *sheets), drawing)
    assert_sound(engine)
    assert_traced(engine, grid(4), UP)


def turns(n: int) -> list[np.ndarray]:
    """About the vertical, by equal angles: all sheets meet in one line."""
    return [
        np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
        for a in np.pi * np.arange(n) / n
    ]
