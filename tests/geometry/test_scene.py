"""Scenes do not change; edits share what stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.errors import DuplicateObjectError, UnknownObjectError
from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.geometry.transform import Transform

MATERIAL = Material(np.full(3, 0.5), np.zeros(3))
TRIANGLE = Mesh(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), ((0, 1, 2),))


def thing(name: str) -> SceneObject:
    return SceneObject(name, TRIANGLE, MATERIAL)


@pytest.fixture
def scene() -> Scene:
    return Scene(objects={name: thing(name) for name in ("a", "b", "c")}, name="room")


def test_objects_come_in_the_order_in_which_they_were_added(scene: Scene) -> None:
    assert [o.id for o in scene] == ["a", "b", "c"]
    assert [o.id for o in scene.with_object(thing("0"))] == ["a", "b", "c", "0"]
    assert [o.id for o in scene.without_object("b")] == ["a", "c"]
    assert [o.id for o in scene.with_replaced(thing("b"))] == ["a", "b", "c"]


def test_edits_leave_the_scene_as_it_was_and_share_the_rest(scene: Scene) -> None:
    before = dict(scene.objects)
    changed = scene.with_object(thing("d")).without_object("a").with_replaced(thing("b"))
    assert dict(scene.objects) == before
    assert changed.object("c") is scene.object("c")
    assert changed.object("b") is not scene.object("b")
    assert changed.name == "room"


def test_edits_refuse_what_is_there_already_or_not_at_all(scene: Scene) -> None:
    with pytest.raises(DuplicateObjectError, match="'a' exists already") as twice:
        scene.with_object(thing("a"))
    assert twice.value.object_id == "a"
    for edit in (scene.without_object, scene.object, lambda name: scene.with_replaced(thing(name))):
        with pytest.raises(UnknownObjectError, match="no object with id 'x'") as missing:
            edit("x")
        assert missing.value.object_id == "x"


def test_world_vertices_are_transformed() -> None:
    placed = replace(
        thing("a"),
        transform=Transform.from_parts(np.array([0, 0, 2.0]), np.array([0, 0, 0, 1.0]), np.full(3, 2.0)),
    )
    np.testing.assert_array_equal(placed.world_vertices, [[0, 0, 2], [2, 0, 2], [0, 2, 2]])
    np.testing.assert_array_equal(thing("a").world_vertices, TRIANGLE.vertices)


def test_camera_basis_is_right_handed_and_keeps_up_up() -> None:
    camera = Camera(
        eye=np.array([3.0, 0.0, 1.6]),
        target=np.array([0.0, 2.0, 1.0]),
        up=np.array([0.0, 0.0, 5.0]),
        vertical_fov=55.0,
        width=640,
        height=480,
    )
    right, up, forward = camera.basis()
    np.testing.assert_allclose(
        np.stack([right, up, forward]) @ np.stack([right, up, forward]).T, np.eye(3), atol=1e-15
    )
    np.testing.assert_allclose(np.cross(right, up), -forward, atol=1e-15)
    np.testing.assert_allclose(
        forward * np.linalg.norm(camera.target - camera.eye), camera.target - camera.eye
    )
    assert up[2] > 0.0 and right[2] == pytest.approx(0.0)
