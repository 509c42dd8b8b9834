"""Parts of objects that are kept over revisions: bit by bit what would be made anew, and let go with them."""

from __future__ import annotations

import gc
import weakref
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.geometry import parts
from solver.geometry.faces import cross
from solver.geometry.parts import part_of
from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.geometry.transform import Transform

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
NOTCHED = [(0, 0, 2), (2, 0, 2), (2, 1, 2), (1, 1, 2), (1, 2, 2), (0, 2, 2)]
SPECK = [(0, 0, 1), (1e-9, 0, 1), (1e-9, 1e-9, 1)]
LINE = [(0, 0, 0), (1, 1, 0), (2, 2, 0)]
MESH = Mesh(
    np.array(SQUARE + NOTCHED + SPECK + LINE, dtype=float),
    ((0, 1, 2, 3), (4, 5, 6, 7, 8, 9), (10, 11, 12), (13, 14, 15)),
)
"""A mesh with a face of each fate; its speck is one in scenes of more than a kilometre alone."""


def thing(name: str, at: tuple[float, float, float] = (0.0, 0.0, 0.0), scale: float = 1.0) -> SceneObject:
    turn = np.array([0.1, 0.2, 0.3, 0.9])
    placed = Transform.from_parts(np.array(at), turn, np.full(3, scale))
    return SceneObject(name, MESH, Material(np.array([0.1, 0.2, 0.3]), np.zeros(3)), placed)


def anew(scene: Scene) -> Scene:
    """An equal scene of objects that nobody has seen."""
    return replace(scene, objects={name: replace(o) for name, o in scene.objects.items()})


def assert_same(a: Surfaces, b: Surfaces) -> None:
    for item in fields(Surfaces):
        ours, theirs = getattr(a, item.name), getattr(b, item.name)
        if isinstance(ours, np.ndarray):
            assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape), item.name
            assert ours.tobytes() == theirs.tobytes(), item.name
        else:
            assert ours == theirs, item.name


EDITS = st.tuples(
    st.sampled_from(["move", "paint", "remove", "add", "back"]),
    st.integers(0, 5),
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    st.sampled_from([-1.0, 1.0, 1.0, 1e4]),
)


@given(st.lists(EDITS, max_size=12))
def test_after_edits_surfaces_are_those_of_a_fresh_scene(
    edits: list[tuple[str, int, tuple[float, float, float], float]],
) -> None:
    scene = Scene(objects={name: thing(name, (k, 0.0, 0.0)) for k, name in enumerate("abcd")})
    past = [scene]
    flatten(scene)
    for what, which, at, scale in edits:
        if what == "back":
            scene = past[which % len(past)]
        elif what == "add" or not scene.objects:
            name = f"new {len(past)}"
            scene = scene.with_object(thing(name, at, scale))
        else:
            name = list(scene.objects)[which % len(scene.objects)]
            old = scene.object(name)
            if what == "remove":
                scene = scene.without_object(name)
            elif what == "move":
                scene = scene.with_replaced(replace(old, transform=thing(name, at, scale).transform))
            else:
                paint = Material(np.abs(np.array(at)) / 4.0, np.ones(3), two_sided=not old.material.two_sided)
                scene = scene.with_replaced(replace(old, material=paint))
        past.append(scene)
        assert_same(flatten(scene), flatten(anew(scene)))


def test_a_part_is_kept_while_the_scene_leaves_the_same_faces() -> None:
    source = thing("a")
    part = part_of(source, 10.0)
    assert part.face_count == 3
    assert part_of(source, 300.0) is part
    in_the_large = part_of(source, 1e4)
    assert in_the_large.face_count == 2, "the speck is gone"
    assert part_of(source, 1e5) is in_the_large
    assert part_of(source, 10.0).face_count == 3, "and back again"


def test_parts_go_with_their_objects() -> None:
    source = thing("a")
    part_of(source, 10.0)
    known, gone = len(parts._PARTS), weakref.ref(source)
    del source
    gc.collect()
    assert gone() is None
    assert len(parts._PARTS) < known


def test_surfaces_may_be_written_to_without_changing_the_next() -> None:
    scene = Scene(objects={"a": thing("a")})
    first = flatten(scene)
    kept = first.corners.copy()
    first.corners[:] = 0.0
    np.testing.assert_array_equal(flatten(scene).corners, kept)


@pytest.mark.parametrize(
    "shapes", [((4, 3), (4, 3)), ((2, 5, 3), (2, 5, 3)), ((3,), (7, 3)), ((0, 3), (0, 3))]
)
def test_cross_products_are_those_of_the_library(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    random = np.random.default_rng(5)
    a, b = (random.normal(size=shape) for shape in shapes)
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
