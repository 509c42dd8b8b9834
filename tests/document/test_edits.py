"""Edits: what each makes of a scene, and that a refused batch leaves no trace."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from solver.document.conversion import scene_of
from solver.document.edits import Edit, apply_edits
from solver.document.models import SceneDocument
from solver.errors import SceneError
from solver.geometry.scene import Scene

EDITS: TypeAdapter[list[Edit]] = TypeAdapter(list[Edit])
TRIANGLE = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}


@pytest.fixture
def scene() -> Scene:
    objects = [
        {"id": name, "mesh": TRIANGLE, "material": {"reflectance": [0.1, 0.2, 0.3], "emission": [1, 1, 1]}}
        for name in ("a", "b", "c")
    ]
    return scene_of(SceneDocument.model_validate({"objects": objects}))


def edited(scene: Scene, *edits: dict[str, Any]) -> Scene:
    return apply_edits(scene, EDITS.validate_python(list(edits)))


def test_each_edit_does_what_it_says(scene: Scene) -> None:
    moved = edited(scene, {"op": "move", "id": "b", "transform": {"translation": [0, 0, 2]}})
    assert np.allclose(moved.object("b").world_vertices[:, 2], 2.0)
    assert list(moved.objects) == ["a", "b", "c"], "objects keep their order"

    assert list(edited(scene, {"op": "remove", "id": "b"}).objects) == ["a", "c"]
    assert list(edited(scene, {"op": "add", "object": {"id": "d", "mesh": TRIANGLE}}).objects)[-1] == "d"

    reshaped = edited(scene, {"op": "set_mesh", "id": "a", "mesh": {"vertices": [], "faces": []}})
    assert len(reshaped.object("a").mesh.vertices) == 0
    assert np.array_equal(reshaped.object("a").material.emission, [1, 1, 1])


def test_a_material_replaces_the_one_before_wholly(scene: Scene) -> None:
    changed = edited(scene, {"op": "set_material", "id": "a", "material": {"reflectance": [0.9, 0.9, 0.9]}})
    assert np.array_equal(changed.object("a").material.reflectance, [0.9, 0.9, 0.9])
    assert not changed.object("a").material.emission.any(), "what is not given has its default"


def test_a_transform_replaces_the_one_before_wholly(scene: Scene) -> None:
    first = {"op": "move", "id": "a", "transform": {"translation": [1, 0, 0], "scale": 3}}
    second = {"op": "move", "id": "a", "transform": {"translation": [0, 1, 0]}}
    moved = edited(scene, first, second).object("a")
    assert np.allclose(moved.world_vertices[0], [0, 1, 0])
    assert np.allclose(moved.world_vertices[1], [1, 1, 0])


def test_edits_of_a_batch_see_one_another(scene: Scene) -> None:
    after = edited(
        scene,
        {"op": "remove", "id": "a"},
        {"op": "add", "object": {"id": "a", "mesh": TRIANGLE}},
        {"op": "move", "id": "a", "transform": {"translation": [7, 0, 0]}},
    )
    assert list(after.objects) == ["b", "c", "a"]
    assert after.object("a").world_vertices[0, 0] == 7.0


BAD: list[tuple[dict[str, Any], tuple[str | int, ...]]] = [
    ({"op": "remove", "id": "x"}, ("edits", 1, "id")),
    ({"op": "move", "id": "x", "transform": {}}, ("edits", 1, "id")),
    ({"op": "add", "object": {"id": "a", "mesh": TRIANGLE}}, ("edits", 1, "object", "id")),
    (
        {"op": "add", "object": {"id": "d", "mesh": {"vertices": [], "faces": [[0, 1, 2]]}}},
        ("edits", 1, "object", "mesh", "faces", 0, 0),
    ),
    (
        {"op": "set_mesh", "id": "a", "mesh": {"vertices": [[0, 0, 0]], "faces": [[0, 0, 1]]}},
        ("edits", 1, "mesh", "faces", 0, 2),
    ),
    (
        {"op": "set_material", "id": "a", "material": {"reflectance": [0, 0, 0.5], "specular": [0, 0, 0.5]}},
        ("edits", 1, "material", "specular", 2),
    ),
    (
        {"op": "add", "object": {"id": "d", "mesh": TRIANGLE, "material": {"specular": [0.6, 0, 0]}}},
        ("edits", 1, "object", "material", "specular", 0),
    ),
    (
        {"op": "move", "id": "a", "transform": {"translation": [1e9, 0, 0], "scale": 9}},
        ("edits", 1, "transform"),
    ),
]


@pytest.mark.parametrize(("bad", "location"), BAD)
def test_a_refused_batch_names_the_field_and_changes_nothing(
    scene: Scene, bad: dict[str, Any], location: tuple[str | int, ...]
) -> None:
    before = dict(scene.objects)
    with pytest.raises(SceneError) as refused:
        edited(scene, {"op": "remove", "id": "c"}, bad)
    assert refused.value.location == location
    assert dict(scene.objects) == before
