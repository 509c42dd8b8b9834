"""Meshes after edits and refinement: what is kept of the mesh before makes no difference to what is drawn."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.geometry.scene import Scene, SceneObject
from solver.geometry.surfaces import Surfaces, flatten
from solver.geometry.transform import Transform
from solver.rendering.device import GlDevice
from solver.rendering.leaf_blocks import earlier_patches
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.tessellation import RenderMesh, Tessellator
from solver.transport.field import RadiosityField
from solver.types import FloatArray
from tests.rendering.fields import SQUARE, Split, build_field, camera, polygons

TRIANGLES = [
    [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)],
    [(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 0.0, 1.0)],
]
WALL = [(0.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.0)]


def thing(name: str, place: int) -> SceneObject:
    """Some faces that meet those of their neighbours in the row, along a common line or more."""
    made = polygons(SQUARE, WALL, *TRIANGLES, name=name, two_sided=len(name) > 1)
    at = Transform.from_parts(np.array([float(place), 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]), np.ones(3))
    return replace(made, transform=at)


def chance(salt: int) -> Split:
    """Split by what a leaf is, so that a patch that stays is split alike."""

    def rule(corners: FloatArray, level: int) -> bool:
        return level < 3 and zlib.crc32(corners.tobytes(), salt) % 3 > 0

    return rule


def field_of(surfaces: Surfaces, salts: Sequence[int], seed: int) -> RadiosityField:
    """Leaves of each patch by one of two rules, in any order of patches, in any light."""
    random = np.random.default_rng(seed)
    rules = [build_field(surfaces, chance(salt)) for salt in (0, 1)]
    chosen = np.array([salts[patch % len(salts)] for patch in range(surfaces.patch_count)], dtype=np.int64)
    used = [np.flatnonzero(chosen[field.patch] == salt) for salt, field in enumerate(rules)]
    count = sum(len(kept) for kept in used)
    order = random.permutation(count)
    parts = {
        item.name: np.concatenate([getattr(f, item.name)[kept] for f, kept in zip(rules, used, strict=True)])[
            order
        ]
        for item in fields(RadiosityField)
    }
    return replace(RadiosityField(**parts), irradiance=random.random((count, 3)))


def assert_same(a: RenderMesh, b: RenderMesh) -> None:
    for item in fields(RenderMesh):
        ours, theirs = getattr(a, item.name), getattr(b, item.name)
        if isinstance(ours, np.ndarray):
            assert ours.dtype == theirs.dtype, item.name
            np.testing.assert_array_equal(ours, theirs, err_msg=item.name)


EDITS = st.tuples(
    st.sampled_from(["move", "remove", "add", "none"]),
    st.integers(0, 3),
    st.integers(-1, 5),
    st.lists(st.integers(0, 1), min_size=1, max_size=7),
)


@given(st.lists(EDITS, min_size=1, max_size=4), st.integers(0, 100))
@settings(max_examples=40)
def test_meshes_after_edits_are_those_of_a_fresh_start(
    edits: list[tuple[str, int, int, list[int]]], seed: int
) -> None:
    scene = Scene(objects={name: thing(name, k) for k, name in enumerate(("a", "bb", "c"))})
    surfaces = flatten(scene)
    kept = Tessellator(surfaces)
    kept.mesh(field_of(surfaces, [0], seed))
    for number, (what, which, place, salts) in enumerate(edits):
        name = list(scene.objects)[which % len(scene.objects)]
        if what == "move":
            scene = scene.with_replaced(thing(name, place))
        elif what == "remove" and len(scene.objects) > 1:
            scene = scene.without_object(name)
        elif what == "add":
            scene = scene.with_object(thing(f"new {number}", place))
        if what != "none":
            surfaces = flatten(scene)
            kept = Tessellator(surfaces, kept)
        field = field_of(surfaces, salts, seed + number)
        assert_same(kept.mesh(field), Tessellator(surfaces).mesh(field))
        brighter = replace(field, irradiance=2.0 * field.irradiance)
        assert_same(kept.mesh(brighter), Tessellator(surfaces).mesh(brighter))


def test_light_alone_leaves_positions_and_outlines_as_they_are() -> None:
    surfaces = flatten(Scene(objects={"a": thing("a", 0)}))
    tessellator = Tessellator(surfaces)
    field = field_of(surfaces, [0, 1], 1)
    first = tessellator.mesh(field)
    for corners in (field.corners, field.corners.copy()):
        second = tessellator.mesh(replace(field, corners=corners, irradiance=field.irradiance + 1.0))
        assert second.position is first.position and second.leaf is first.leaf


def test_patches_are_known_by_object_and_rank() -> None:
    before = flatten(Scene(objects={name: thing(name, k) for k, name in enumerate("abc")}))
    places = {"new": 3, "c": 2, "a": 0, "bb": 1}
    after = flatten(Scene(objects={name: thing(name, k) for name, k in places.items()}))
    n, new = 4, 8
    expected = np.concatenate([np.full(new, -1), np.arange(2 * n, 3 * n), np.arange(n), np.full(2 * n, -1)])
    np.testing.assert_array_equal(earlier_patches(after, before), expected)
    np.testing.assert_array_equal(earlier_patches(before, before), np.arange(3 * n))
    twice = flatten(Scene(objects={"a": replace(thing("bb", 0), id="a")}))
    assert np.all(earlier_patches(twice, before) == -1), "with other faces it is another object"


@pytest.mark.parametrize("shading", [Shading.FLAT, Shading.GOURAUD])
def test_frames_after_an_edit_are_those_of_a_fresh_start(device: GlDevice, shading: Shading) -> None:
    renderer, other = FrameRenderer(device), FrameRenderer(device)
    scene = Scene(objects={name: thing(name, k) for k, name in enumerate(("a", "bb", "c"))})
    kept: Tessellator | None = None
    view = camera((1.5, -2.0, 1.2), (1.5, 0.6, 0.3))
    shown = []
    for place in (1, 3, 4):
        scene = scene.with_replaced(thing("bb", place))
        surfaces = flatten(scene)
        kept = Tessellator(surfaces, kept)
        field = field_of(surfaces, [0, 1, 1], 4)
        frames = [
            drawn.draw(mesh, view, shading, Layer.RADIANCE)
            for drawn, mesh in ((renderer, kept.mesh(field)), (other, Tessellator(surfaces).mesh(field)))
        ]
        np.testing.assert_array_equal(frames[0], frames[1])
        shown.append(frames[0])
    assert np.any(shown[0] != shown[1]) and np.any(shown[1] != shown[2])
    renderer.release()
    other.release()
