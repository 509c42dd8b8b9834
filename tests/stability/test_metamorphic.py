"""Laws of random small scenes: turned, moved, scaled by a thousand, or told in any order, they are one.

Right means: as bright at every point, within the tolerance, and as much power in all.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.requests import FrameRequest, RendererName
from solver.geometry.scene import Mesh, Scene, SceneObject
from solver.types import FloatArray, Points
from tests.pathtracing.worlds import material
from tests.stability.chain import TOLERANCE, assert_sound, difference, irradiance, power, solve
from tests.stability.places import UP, grid, lamp, room, scene, transformed
from tests.transport.polygons import SEEDS, convex_polygons, rotation

DRAWING: Final[list[Drawing]] = []


@pytest.fixture(autouse=True, scope="module")
def _drawing(drawing: Drawing) -> None:
    """Hypothesis takes no fixtures of functions; this one is of the module."""
    DRAWING[:] = [drawing]


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """The room, its lamp, and one to four polygons in one mesh or apart, some of them two-sided."""
    polygons = [0.5 + 0.35 * p for p in draw(st.lists(convex_polygons(), min_size=1, max_size=4))]
    random = np.random.default_rng(draw(SEEDS))
    two_sided = draw(st.booleans())
    of = material(random.uniform(0.0, 0.9), 0.0, two_sided)
    if draw(st.booleans()):
        vertices = np.concatenate(polygons)
        ends = np.cumsum([0] + [len(p) for p in polygons]).tolist()
        faces = tuple(tuple(range(a, b)) for a, b in pairwise(ends))
        things = [SceneObject("things", Mesh(vertices, faces), of)]
    else:
        things = [SceneObject(f"{k}", Mesh(p, (tuple(range(len(p))),)), of) for k, p in enumerate(polygons)]
    return scene(room(random.uniform(0.1, 0.8)), lamp(), *things)


def solved(of: Scene) -> Engine:
    return solve(of, DRAWING[0])


def assert_alike(
    one: Engine, other: Engine, here: Points, there: Points, up: FloatArray, area: float = 1.0
) -> None:
    """As bright at points `there`, facing `up`, as at points `here`; all areas are `area` times as large."""
    before, after = irradiance(one, here, UP), irradiance(other, there, up)
    # Both are within the tolerance of what is right, and so is the light of all surfaces.
    assert difference(after, before) < 2.0 * TOLERANCE
    np.testing.assert_allclose(power(other), area * np.array(power(one)), rtol=TOLERANCE)


@settings(max_examples=12)
@given(of=scenes(), seed=SEEDS)
def test_turned_and_moved(of: Scene, seed: int) -> None:
    turn = rotation(seed)
    shift = np.random.default_rng(seed).uniform(-10.0, 10.0, 3)
    one, other = solved(of), solved(transformed(of, turn, shift))
    assert_sound(other, frames=False)
    assert_alike(one, other, grid(4), grid(4) @ turn.T + shift, turn @ UP)
    seen = [np.asarray(e.frame(FrameRequest(renderer=RendererName.FLAT)).image).mean() for e in (one, other)]
    assert seen[1] == pytest.approx(seen[0], rel=2.0 * TOLERANCE)


@settings(max_examples=10)
@given(of=scenes(), scale=st.sampled_from([1e-3, 1e3]))
def test_scaled_by_a_thousand(of: Scene, scale: float) -> None:
    one, other = solved(of), solved(transformed(of, scale=scale))
    assert_sound(other, frames=False)
    assert_alike(one, other, grid(4), scale * grid(4), UP, scale * scale)


@settings(max_examples=10)
@given(of=scenes(), data=st.data())
def test_told_in_another_order(of: Scene, data: st.DataObject) -> None:
    """Objects, faces, vertices, and the corner that each face begins with."""
    names = data.draw(st.permutations(list(of.objects)))
    random = np.random.default_rng(data.draw(SEEDS))
    objects = {name: shuffled(of.object(name), random) for name in names}
    one, other = solved(of), solved(Scene(objects=objects, cameras=of.cameras))
    assert_sound(other, frames=False)
    assert_alike(one, other, grid(4), grid(4), UP)


def shuffled(source: SceneObject, random: np.random.Generator) -> SceneObject:
    """The object with its mesh told in another order."""
    n = len(source.mesh.vertices)
    order = random.permutation(n)
    place = np.argsort(order)
    faces = []
    for k in random.permutation(len(source.mesh.faces)):
        face = source.mesh.faces[k]
        first = int(random.integers(len(face)))
        faces.append(tuple(int(place[v]) for v in face[first:] + face[:first]))
    return SceneObject(source.id, Mesh(source.mesh.vertices[order], tuple(faces)), source.material)


@settings(max_examples=10)
@given(of=scenes(), factor=st.sampled_from([1e-6, 1e3, 1e9]))
def test_brighter_lamps(of: Scene, factor: float) -> None:
    brighter = SceneObject("lamp", of.object("lamp").mesh, material(0.0, 10.0 * factor))
    one, other = solved(of), solved(of.with_replaced(brighter))
    before, after = irradiance(one, grid(4), UP), irradiance(other, grid(4), UP)
    assert difference(after / factor, before) < TOLERANCE


@settings(max_examples=10)
@given(of=scenes())
def test_sound_in_all_renderers(of: Scene) -> None:
    assert_sound(solved(of))
