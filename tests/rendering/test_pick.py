"""What a pixel shows, against the layers of the whole frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.document.samples import load_sample
from solver.errors import LimitExceededError, SceneError
from solver.geometry.surfaces import flatten
from solver.rendering.device import GlDevice
from solver.rendering.meshes import DrawnMesh
from solver.rendering.renderer import FrameRenderer, Layer, Shading
from solver.rendering.tessellation import Tessellator
from tests.rendering.fields import SQUARE, build_field, camera, even, polygons, surfaces_of, uneven
from tests.rendering.interpolant_meshes import random_mesh

LOOK_DOWN = camera((0.4, 0.5, 1.5), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0))


def meshes(name: str) -> list[DrawnMesh]:
    surfaces = flatten(load_sample(name))
    plain = Tessellator(surfaces).mesh(build_field(surfaces, uneven(7, 3)))
    return [plain, random_mesh(surfaces, uneven(7, 3), 1)]


@pytest.mark.parametrize("name", ["cornell", "office"])
def test_picks_are_what_the_layers_show(name: str, renderer: FrameRenderer) -> None:
    scene = load_sample(name)
    view = replace(next(iter(scene.cameras.values())), width=160, height=120)
    for mesh in meshes(name):
        surfaces = mesh.surfaces
        shown = {layer: renderer.draw(mesh, view, Shading.FLAT, layer) for layer in Layer if layer != "error"}
        found = 0
        for x, y in np.random.default_rng(2).integers(0, (160, 120), (60, 2)).tolist():
            pick = renderer.pick(mesh, view, x, y)
            triangle = shown[Layer.TRIANGLE][y, x]
            if pick is None:
                assert triangle == -1
                continue
            found += 1
            assert pick.triangle == triangle
            assert pick.leaf == shown[Layer.ELEMENT][y, x]
            assert pick.object_id == surfaces.object_ids[shown[Layer.OBJECT][y, x]]
            assert pick.patch == mesh.patch[mesh.triangles[triangle, 0]]
            assert pick.face == surfaces.face[pick.patch]
            np.testing.assert_array_equal(pick.normal, surfaces.normal[pick.patch])
            np.testing.assert_allclose(pick.position, shown[Layer.POSITION][y, x], atol=1e-12)
            np.testing.assert_allclose(pick.barycentric, shown[Layer.BARYCENTRIC][y, x], atol=1e-7)
        assert found > 30


def test_nothing_is_picked_where_nothing_is(renderer: FrameRenderer) -> None:
    mesh = random_mesh(surfaces_of(polygons(SQUARE)), even(1), 0)
    assert renderer.pick(mesh, LOOK_DOWN, 0, 0) is None
    assert renderer.pick(mesh, LOOK_DOWN, 40, 30) is not None


def test_the_back_of_a_face_is_picked_as_the_face(renderer: FrameRenderer) -> None:
    mesh = random_mesh(surfaces_of(polygons(SQUARE, name="sheet")), even(1), 0)
    pick = renderer.pick(mesh, replace(LOOK_DOWN, eye=np.array([0.4, 0.5, -1.5])), 40, 30)
    assert pick is not None
    assert (pick.object_id, pick.face) == ("sheet", 0)
    assert pick.normal.tolist() == [0.0, 0.0, 1.0]
    np.testing.assert_allclose(pick.position, [0.5, 0.5, 0.0], atol=0.02)


@pytest.mark.parametrize(("x", "y", "name"), [(-1, 0, "x"), (80, 0, "x"), (0, -1, "y"), (0, 60, "y")])
def test_pixels_outside_the_frame_name_the_coordinate(
    x: int, y: int, name: str, renderer: FrameRenderer
) -> None:
    mesh = random_mesh(surfaces_of(polygons(SQUARE)), even(0), 0)
    with pytest.raises(SceneError) as refused:
        renderer.pick(mesh, LOOK_DOWN, x, y)
    assert refused.value.location == (name,)


def test_frames_that_cannot_be_drawn_cannot_be_picked_from(renderer: FrameRenderer, device: GlDevice) -> None:
    mesh = random_mesh(surfaces_of(polygons(SQUARE)), even(0), 0)
    with pytest.raises(LimitExceededError, match="width"):
        renderer.pick(mesh, replace(LOOK_DOWN, width=device.largest_frame[0] + 1), 0, 0)
