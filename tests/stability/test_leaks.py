"""Light that must not come through: at shared edges, at T-junctions, through walls of no thickness.

Right means: none at all, where walls meet; what is dark is exactly dark.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.geometry.scene import SceneObject
from solver.types import FloatArray
from tests.pathtracing.worlds import CUBE, INWARD, polygon
from tests.stability.chain import TOLERANCE, assert_sound, assert_traced, irradiance, solve
from tests.stability.places import BOTH, GREY, UP, X, Y, crate, grid, lamp, quad, room, scene
from tests.transport.polygons import rotation
from tests.transport.solving import box


def light_of(engine: Engine, name: str) -> FloatArray:
    """(n, 3) irradiance of the leaves of one object."""
    surfaces, field = engine._world.surfaces, engine._solution.field()
    own = surfaces.object[field.patch] == surfaces.object_ids.index(name)
    return np.asarray(field.irradiance[own])


def strips(count: int, seed: int) -> list[SceneObject]:
    """The room with each wall in strips of its own, so that no two walls share the ends of their edges."""
    random = np.random.default_rng(seed)
    made = []
    for wall, face in enumerate(INWARD):
        a, b, c, d = CUBE[list(face)]
        cuts = np.concatenate([[0.0], np.sort(random.uniform(0.0, 1.0, count - 1)), [1.0]])
        for k in range(count):
            s, t = cuts[k], cuts[k + 1]
            corners = [a + s * (b - a), a + t * (b - a), d + t * (c - d), d + s * (c - d)]
            made.append(polygon(f"{wall}.{k}", np.array(corners), GREY))
    return made


@pytest.mark.parametrize("thickness", [0.0, 1e-6, 1e-4, 1e-2])
def test_the_next_room_is_dark(thickness: float, drawing: Drawing) -> None:
    dark = box("dark", 0.5, 0.0, (1.0 + thickness, 0.0, 0.0), (2.0 + thickness, 1.0, 1.0))
    engine = solve(scene(room(), dark, lamp()), drawing)
    assert_sound(engine, frames=thickness == 0.0)
    assert not light_of(engine, "dark").any()
    near = np.array([[1.0 + thickness + 1e-4, 0.5, 1e-3], [1.5, 0.5, 0.5], [1.0001 + thickness, 0.0, 0.0]])
    assert not irradiance(engine, near, UP).any()
    assert_traced(engine, grid(4), UP)


@pytest.mark.parametrize("count", [3, 8])
def test_t_junctions_are_tight(count: int, drawing: Drawing) -> None:
    """A room whose walls share no vertices, in a dark one, and the same turned out of all axes."""
    outer = box("outer", 0.5, 0.0, (-0.5, -0.5, -0.5), (1.5, 1.5, 1.5))
    walls = strips(count, 3)
    engine = solve(scene(*walls, outer, lamp()), drawing)
    assert_sound(engine, frames=count == 3)
    assert_traced(engine, grid(4), UP)
    assert not light_of(engine, "outer").any()


def test_t_junctions_are_tight_from_outside(drawing: Drawing) -> None:
    """The lamp is outside, and the walls are turned out of all axes, so that rays meet edges as they may."""
    turn = rotation(5)
    inner = [
        SceneObject(
            o.id, type(o.mesh)((o.mesh.vertices - 0.5) @ turn.T * 0.4 + 0.5, o.mesh.faces), o.material
        )
        for o in strips(4, 7)
    ]
    shining = quad("lamp", [0.3, 0.3, 0.98], 0.4 * Y, 0.4 * X, lamp().material)
    engine = solve(scene(room(), *inner, shining), drawing)
    assert_sound(engine, frames=False)
    # Pairs with next to nothing above each other's horizon are taken as half visible, for want of rays.
    lit = light_of(engine, "room").max()
    for o in inner:
        assert light_of(engine, o.id).max() < 1e-3 * lit


@pytest.mark.parametrize("pieces", [1, 7])
def test_a_sheet_parts_a_room(pieces: int, drawing: Drawing) -> None:
    """A wall without thickness, whole and in strips, keeps the light on the lamp's side.

    But for leaves on both sides of it, which are lit on average.
    """
    cuts = np.linspace(0.0, 1.0, pieces + 1) ** 1.3
    sheets = [
        quad(f"{k}", [a, 0.25, 0.0], [b - a, 0.0, 0.0], [0.0, 0.0, 1.0], BOTH)
        for k, (a, b) in enumerate(pairwise(cuts))
    ]
    engine = solve(scene(room(), lamp(), *sheets), drawing)
    assert_sound(engine)
    behind = grid(5) * [1.0, 0.24, 1.0]
    lit = irradiance(engine, grid(5)[10:], UP)
    assert irradiance(engine, behind, UP).max() < 0.02 * lit.mean()
    field = engine._solution.field()
    wholly = field.corners[:, :, 1].max(axis=1) <= 0.25 - 1e-9
    assert wholly.any() and field.irradiance[wholly].max() < TOLERANCE * lit.mean()


@pytest.mark.parametrize("thickness", [1e-2, 1e-4, 1e-6])
def test_a_thin_wall_parts_a_room(thickness: float, drawing: Drawing) -> None:
    wall = crate("wall", (0.0, 0.25 - thickness, 0.0), (1.0, 0.25, 1.0))
    engine = solve(scene(room(), lamp(), wall), drawing)
    assert_sound(engine, frames=thickness == 1e-4)
    dark = irradiance(engine, grid(5) * [1.0, 0.23, 1.0], UP)
    assert dark.max() < TOLERANCE * irradiance(engine, grid(5)[10:], UP).mean()
    whole = solve(scene(room(), lamp(), quad("wall", [0.0, 0.25, 0.0], X, [0.0, 0.0, 1.0], BOTH)), drawing)
    lit = grid(5)[10:]
    np.testing.assert_allclose(irradiance(engine, lit, UP), irradiance(whole, lit, UP), rtol=0.03)


def test_a_box_closed_by_its_edges_alone(drawing: Drawing) -> None:
    """A lamp in a box that floats in the room: nothing comes out of it."""
    shell = box("shell", 0.5, 0.0, (0.3, 0.3, 0.3), (0.7, 0.7, 0.7))
    inside = quad("lamp", [0.4, 0.4, 0.6], 0.2 * Y, 0.2 * X, lamp().material)
    engine = solve(scene(room(), shell, inside), drawing)
    assert_sound(engine)
    assert not light_of(engine, "room").any()
