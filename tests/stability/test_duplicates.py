"""Equal objects at one place. Right means: the light is that of one of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.engine.drawing import Drawing
from solver.geometry.scene import SceneObject
from tests.stability.chain import assert_sound, irradiance, power, solve
from tests.stability.places import BOTH, UP, X, Y, crate, grid, lamp, quad, room, scene

CRATE = crate("thing", (0.3, 0.3, 0.2), (0.6, 0.6, 0.5))
THINGS = {
    "crate": CRATE,
    "sheet": quad("thing", [0.3, 0.3, 0.4], 0.4 * X, 0.4 * Y, BOTH),
    "lamp": lamp(0.5, name="thing"),
    "room": room(name="thing"),
}


@pytest.mark.parametrize("name", THINGS)
def test_many_of_a_thing_are_one(name: str, drawing: Drawing) -> None:
    thing = THINGS[name]
    copies = [replace(thing, id=f"{thing.id}{k}") for k in range(4)]
    others = [lamp()] if name == "room" else [room(), lamp()]
    one, many = (solve(scene(*others, *of), drawing) for of in ([thing], copies))
    assert_sound(one)
    assert_sound(many)
    assert power(many) == pytest.approx(power(one), rel=1e-9)
    np.testing.assert_allclose(irradiance(many, grid(5), UP), irradiance(one, grid(5), UP), rtol=1e-6)


def test_a_face_given_twice_in_one_mesh(drawing: Drawing) -> None:
    mesh = replace(CRATE.mesh, faces=(*CRATE.mesh.faces, *CRATE.mesh.faces))
    once, twice = (
        solve(scene(room(), lamp(), SceneObject("thing", m, CRATE.material)), drawing)
        for m in (CRATE.mesh, mesh)
    )
    assert_sound(twice)
    assert power(twice) == pytest.approx(power(once), rel=1e-9)


def test_faces_back_to_back_are_a_face_with_two_sides(drawing: Drawing) -> None:
    """As many files have them: once with each winding."""
    sheet = THINGS["sheet"]
    faces = (*sheet.mesh.faces, *(face[::-1] for face in sheet.mesh.faces))
    pair = SceneObject("thing", replace(sheet.mesh, faces=faces), replace(BOTH, two_sided=False))
    one, other = (solve(scene(room(), lamp(), thing), drawing) for thing in (sheet, pair))
    assert_sound(other)
    assert power(other) == pytest.approx(power(one), rel=1e-6)
