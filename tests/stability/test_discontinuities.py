"""Discontinuities in awkward company: collinear by the hundred, nearly parallel, through vertices.

Right means: the leaves are triangulated all the same, and what their interpolants show is what the light is.
"""

from __future__ import annotations

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import RendererName
from solver.geometry.scene import Scene, SceneObject
from tests.pathtracing.worlds import material, polygon
from tests.stability.chain import SETTINGS, TOLERANCE, assert_sound, complete, difference, solve
from tests.stability.places import BOTH, SHINING, UP, X, Y, lamp, quad, room, scene, seen_from

DOWN = seen_from(np.array([0.5, 0.5, 0.85]), np.array([0.5, 0.501, 0.0]))
"""Sees the floor from below the lamp"""


def looked_at(*objects: SceneObject) -> Scene:
    """A scene seen from above."""
    return Scene(objects=scene(*objects).objects, cameras={"main": DOWN})


def assert_shown(engine: Engine, longest: int = 40_000) -> None:
    """Interpolants show what a gather at every pixel does."""
    assert_sound(engine)
    shown, exact = (complete(engine, name) for name in (RendererName.INTERPOLANT, RendererName.GATHER))
    # Pixels at edges show other surfaces, or either side of a shadow's.
    off = np.abs(shown - exact).max(axis=-1)
    usual = off <= np.quantile(off, 0.97)
    assert difference(shown[usual], exact[usual]) < TOLERANCE
    fine = engine.status().fine
    assert 0 < fine.triangles < longest


def test_hundreds_of_collinear_discontinuities_in_one_leaf(drawing: Drawing) -> None:
    """A fence of 200 boards in one plane: their edges at top and bottom are two lines."""
    boards = [
        quad(f"{k}", [0.1 + 0.004 * k, 0.5, 0.3], [3e-3, 0.0, 0.0], [0.0, 0.0, 0.2], BOTH) for k in range(200)
    ]
    above = quad("lamp", [0.495, 0.3, 0.9], 0.4 * Y, 0.01 * X, SHINING)
    engine = solve(looked_at(room(0.3), above, *boards), drawing)
    assert_shown(engine)
    assert engine.status().fine.discontinuities > 400


@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-6, 1e-8])
def test_nearly_parallel_edges(angle: float, drawing: Drawing) -> None:
    """Sheets over each other, each turned a little from the one below, and so are their shadows."""
    sheets = []
    for k in range(6):
        c, s = np.cos(k * angle), np.sin(k * angle)
        flat = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]) @ np.array([[c, s], [-s, c]])
        corners = np.column_stack([flat + 0.5, np.full(4, 0.3 + 1e-3 * k)])
        sheets.append(polygon(f"{k}", corners, BOTH))
    small = quad("lamp", [0.45, 0.45, 0.9], 0.1 * Y, 0.1 * X, material(0.0, 100.0))
    assert_shown(solve(looked_at(room(0.3), small, *sheets), drawing))


@pytest.mark.parametrize("tilt", [1e-3, 1e-6, 1e-9])
def test_nearly_coplanar_sheets(tilt: float, drawing: Drawing) -> None:
    """Planes that meet the floor in lines that all but coincide."""
    sheets = [
        polygon(
            f"{k}",
            [(0.3, 0.4 + k * tilt, 0.0), (0.7, 0.4 - k * tilt, 0.0), (0.7, 0.4, 0.3), (0.3, 0.4, 0.3)],
            BOTH,
        )
        for k in range(3)
    ]
    assert_shown(solve(looked_at(room(0.3), lamp(), *sheets), drawing))


def test_vertices_on_discontinuities(drawing: Drawing) -> None:
    """Shadows of one sheet end at vertices of the tiles of the floor, and run along their edges.

    Lamp and sheet are such that the shadow's edges are where tiles meet.
    """
    tiles = [
        quad(f"{i}{j}", [0.25 * i, 0.25 * j, 0.0], 0.25 * X, 0.25 * Y, material(0.5))
        for i in range(4)
        for j in range(4)
    ]
    above = quad("lamp", [0.25, 0.25, 0.8], 0.5 * Y, 0.5 * X, SHINING)
    sheet = quad("sheet", [0.375, 0.375, 0.4], 0.25 * X, 0.25 * Y, BOTH)
    assert_shown(solve(looked_at(above, sheet, *tiles), drawing))


def test_a_corner_stands_on_a_corner(drawing: Drawing) -> None:
    """Crates that share a vertical edge, on the corner of a rug, below the corner of the lamp."""
    rug = quad("rug", [0.5, 0.5, 0.0], 0.3 * X, 0.3 * Y, material(0.7))
    posts = [
        quad(f"{k}", [0.5, 0.5, 0.0], 0.2 * np.array([np.cos(a), np.sin(a), 0.0]), 0.3 * UP, BOTH)
        for k, a in enumerate(np.pi * np.arange(8) / 4.0)
    ]
    above = quad("lamp", [0.5, 0.5, 0.9], 0.3 * Y, 0.3 * X, SHINING)
    assert_shown(solve(looked_at(room(0.3), above, rug, *posts), drawing))


def test_no_more_lines_than_a_leaf_may_have(drawing: Drawing) -> None:
    """Slats at all angles over one floor: most of their shadows' edges are left out, and counted."""
    random = np.random.default_rng(4)
    slats = []
    for k in range(60):
        at, turn = random.uniform(0.2, 0.8, 2), random.uniform(0.0, np.pi)
        along = 0.1 * np.array([np.cos(turn), np.sin(turn), 0.0])
        across = 0.01 * np.array([-np.sin(turn), np.cos(turn), 0.0])
        slats.append(quad(f"{k}", [*at, random.uniform(0.2, 0.6)], along, across, BOTH))
    engine = solve(looked_at(room(0.3), lamp(), *slats), drawing, SETTINGS)
    assert_sound(engine)
    fine = engine.status().fine
    assert fine.discontinuities_crowded > 0 and fine.triangles < 100_000
