"""Scene documents: what is refused and where, what is filled in, and the way there and back."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from solver.document.conversion import document_of, scene_of
from solver.document.limits import SceneLimits
from solver.document.models import SceneDocument
from solver.document.samples import load_sample, load_scene, parse_scene, sample_names
from solver.document.settings import SettingsDocument
from solver.errors import LimitExceededError, SceneError
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings

SQUARE: dict[str, Any] = {
    "vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    "faces": [[0, 1, 2, 3]],
}


def scene_with(**changes: Any) -> dict[str, Any]:
    return {"objects": [{"id": "a", "mesh": SQUARE, **changes}]}


def read(document: dict[str, Any]) -> Scene:
    return parse_scene(json.dumps(document).encode())


def scene_with_vertex(*vertex: Any) -> dict[str, Any]:
    return scene_with(mesh={"vertices": [vertex], "faces": []})


def there_and_back(scene: Scene) -> Scene:
    """What posting the scene that is told gives: a transform is told by its parts or its matrix, not both."""
    return parse_scene(document_of(scene).model_dump_json(exclude_unset=True).encode())


def assert_same(a: Scene, b: Scene) -> None:
    """Equal to the last bit, but for names of the same things."""
    assert list(a.objects) == list(b.objects)
    assert (a.name, a.luminous_efficacy) == (b.name, b.luminous_efficacy)
    for one, other in zip(a, b, strict=True):
        assert one.mesh.faces == other.mesh.faces
        assert np.array_equal(one.mesh.vertices, other.mesh.vertices)
        assert np.array_equal(one.transform.matrix, other.transform.matrix)
        assert np.array_equal(one.material.reflectance, other.material.reflectance)
        assert np.array_equal(one.material.emission, other.material.emission)
        assert one.material.two_sided is other.material.two_sided
        assert np.array_equal(one.material.specular, other.material.specular)
        assert one.material.exponent == other.material.exponent
        assert one.material.emission_exponent == other.material.emission_exponent
    assert list(a.cameras) == list(b.cameras)
    for name, camera in a.cameras.items():
        twin = b.cameras[name]
        assert np.array_equal(camera.eye, twin.eye)
        assert np.array_equal(camera.target, twin.target)
        assert np.array_equal(camera.up, twin.up)
        assert (camera.vertical_fov, camera.width, camera.height) == (
            twin.vertical_fov,
            twin.width,
            twin.height,
        )


@pytest.mark.parametrize(
    ("document", "location"),
    [
        ({"objcts": []}, ("objcts",)),
        (scene_with(colour=[1, 0, 0]), ("objects", 0, "colour")),
        (scene_with(id=""), ("objects", 0, "id")),
        (scene_with(id=7), ("objects", 0, "id")),
        ({"objects": [{"id": "a"}]}, ("objects", 0, "mesh")),
        (scene_with(mesh={**SQUARE, "faces": [[0, 1]]}), ("objects", 0, "mesh", "faces", 0)),
        (scene_with(mesh={**SQUARE, "faces": [[0, 1, -1]]}), ("objects", 0, "mesh", "faces", 0, 2)),
        (scene_with(mesh={**SQUARE, "faces": [[0, 1, 2], [0, 4, 1]]}), ("objects", 0, "mesh", "faces", 1, 1)),
        (scene_with(mesh={**SQUARE, "faces": [[0, 1, 2.5]]}), ("objects", 0, "mesh", "faces", 0, 2)),
        (scene_with_vertex(0, 0), ("objects", 0, "mesh", "vertices", 0)),
        (scene_with_vertex(0, 0, "1"), ("objects", 0, "mesh", "vertices", 0, 2)),
        (
            scene_with(mesh={"vertices": [[0, 0, True]], "faces": []}),
            ("objects", 0, "mesh", "vertices", 0, 2),
        ),
        (
            scene_with(mesh={"vertices": [[0, 0, 1e10]], "faces": []}),
            ("objects", 0, "mesh", "vertices", 0, 2),
        ),
        (scene_with_vertex(0, 0, math.nan), ("objects", 0, "mesh", "vertices", 0, 2)),
        (scene_with(material={"reflectance": [1.0, 0, 0]}), ("objects", 0, "material", "reflectance", 0)),
        (scene_with(material={"reflectance": [0.5, 0.5]}), ("objects", 0, "material", "reflectance")),
        (scene_with(material={"emission": [0, 0, -1]}), ("objects", 0, "material", "emission", 2)),
        (scene_with(material={"emission": [0, 0, math.inf]}), ("objects", 0, "material", "emission", 2)),
        (scene_with(material={"two_sided": 1}), ("objects", 0, "material", "two_sided")),
        (scene_with(material={"specular": [0, 0, -0.1]}), ("objects", 0, "material", "specular", 2)),
        (scene_with(material={"specular": 0.1}), ("objects", 0, "material", "specular")),
        (scene_with(material={"exponent": -1}), ("objects", 0, "material", "exponent")),
        (scene_with(material={"exponent": 1e7}), ("objects", 0, "material", "exponent")),
        (scene_with(material={"exponent": math.inf}), ("objects", 0, "material", "exponent")),
        (scene_with(material={"emission_exponent": -1}), ("objects", 0, "material", "emission_exponent")),
        (scene_with(material={"emission_exponent": None}), ("objects", 0, "material", "emission_exponent")),
        (
            scene_with(material={"reflectance": [0.2, 0.75, 0.8], "specular": [0.3, 0.25, 0.3]}),
            ("objects", 0, "material", "specular", 1),
        ),
        (scene_with(material={"specular": [0, 0.5, 0]}), ("objects", 0, "material", "specular", 1)),
        (scene_with(transform={"rotation": [0, 0, 0, 0]}), ("objects", 0, "transform", "rotation")),
        (scene_with(transform={"rotation": [0, 0, 1]}), ("objects", 0, "transform", "rotation")),
        (scene_with(transform={"scale": 0}), ("objects", 0, "transform", "scale")),
        (scene_with(transform={"scale": [1, 0, 1]}), ("objects", 0, "transform", "scale")),
        (scene_with(transform={"matrix": [1] * 16}), ("objects", 0, "transform", "matrix")),
        (scene_with(transform={"matrix": [0] * 15 + [1]}), ("objects", 0, "transform", "matrix")),
        (
            scene_with(transform={"matrix": [1, 0, 0, 0] * 4, "scale": 1}),
            ("objects", 0, "transform", "matrix"),
        ),
        (scene_with(transform={"scale": 1e9, "translation": [1e9, 0, 0]}), ("objects", 0, "transform")),
        ({"objects": [{"id": "a", "mesh": SQUARE}] * 2}, ("objects", 1, "id")),
        ({"luminous_efficacy": 0}, ("luminous_efficacy",)),
        ({"cameras": {"main": {"vertical_fov": 180}}}, ("cameras", "main", "vertical_fov")),
        ({"cameras": {"main": {"vertical_fov": 5e-324}}}, ("cameras", "main", "vertical_fov")),
        ({"cameras": {"main": {"up": [0, 1e-200, 0]}}}, ("cameras", "main", "up")),
        (scene_with(transform={"rotation": [0, 1e-160, 0, 0]}), ("objects", 0, "transform", "rotation")),
        ({"cameras": {"main": {"width": 0}}}, ("cameras", "main", "width")),
        ({"cameras": {"main": {"up": [0, 0, 0]}}}, ("cameras", "main", "up")),
        ({"cameras": {"main": {"eye": [1, 1, 1], "target": [1, 1, 1]}}}, ("cameras", "main", "target")),
        (
            {"cameras": {"main": {"eye": [0, 0, 1], "target": [0, 0, 2], "up": [0, 0, -3]}}},
            ("cameras", "main", "up"),
        ),
        ({"objects": {}}, ("objects",)),
        ({"name": None}, ("name",)),
    ],
)
def test_the_field_at_fault_is_named(document: dict[str, Any], location: tuple[str | int, ...]) -> None:
    with pytest.raises(SceneError) as refused:
        read(document)
    assert refused.value.location == location
    assert refused.value.message


def test_matrix_and_parts_exclude_each_other() -> None:
    with pytest.raises(SceneError) as refused:
        read(scene_with(transform={"matrix": np.eye(4).ravel().tolist(), "scale": 1}))
    assert refused.value.location == ("objects", 0, "transform")


@pytest.mark.parametrize("name", sample_names())
def test_samples_come_back_as_they_were(name: str) -> None:
    scene = load_sample(name)
    assert_same(there_and_back(scene), scene)


def test_unknown_sample_is_refused() -> None:
    with pytest.raises(SceneError) as refused:
        load_sample("../samples/cornell")
    assert refused.value.location == ("sample",)


def test_scene_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(scene_with()))
    assert list(load_scene(file).objects) == ["a"]


finite = st.floats(-1e3, 1e3, allow_nan=False)
triples = st.tuples(finite, finite, finite)
quaternions = st.tuples(finite, finite, finite, finite).filter(lambda q: any(abs(part) > 1e-3 for part in q))
factors = st.floats(0.01, 100) | st.floats(-100, -0.01)


@given(
    triples,
    quaternions,
    st.tuples(factors, factors, factors),
    st.floats(0, 0.999),
    st.booleans(),
    st.none() | st.floats(0, 1e6),
    st.floats(0, 1e6),
)
def test_any_object_comes_back_as_it_was(
    translation: tuple[float, ...],
    rotation: tuple[float, ...],
    scale: tuple[float, ...],
    reflectance: float,
    two_sided: bool,
    exponent: float | None,
    emission_exponent: float,
) -> None:
    material = {
        "reflectance": [reflectance] * 3,
        "emission": [1, 2, 3],
        "two_sided": two_sided,
        "specular": [0.9 * (1.0 - reflectance), 0.0, 0.0],
        "exponent": exponent,
        "emission_exponent": emission_exponent,
    }
    scene = read(
        {"cameras": {"c": {"eye": [9, 9, 9]}}}
        | scene_with(
            transform={"translation": translation, "rotation": rotation, "scale": scale},
            material=material,
        )
    )
    assert_same(there_and_back(scene), scene)


def test_rotation_is_normalised_and_applied_between_scale_and_translation() -> None:
    half = math.sqrt(0.5)
    scene = read(
        scene_with(transform={"translation": [5, 0, 0], "rotation": [0, 0, 3 * half, 3 * half], "scale": 2})
    )
    # A quarter turn about z takes (2, 0, 0) to (0, 2, 0).
    assert np.allclose(scene.object("a").world_vertices[1], [5, 2, 0])


def test_what_is_not_given_has_a_default() -> None:
    scene = read(scene_with())
    square = scene.object("a")
    assert scene.luminous_efficacy == 179.0
    assert np.array_equal(square.transform.matrix, np.eye(4))
    assert not square.material.emission.any()
    assert not square.material.two_sided
    assert not square.material.specular.any()
    assert square.material.emission_exponent == 0.0
    assert list(scene.cameras) == ["main"]


def test_specular_reflection_without_an_exponent_is_a_mirror_s() -> None:
    def exponent(**material: Any) -> float:
        scene = read(scene_with(material={"reflectance": [0, 0, 0], "specular": [0.5] * 3, **material}))
        return scene.object("a").material.exponent

    assert exponent() == exponent(exponent=None) == math.inf
    assert exponent(exponent=0) == 0.0 and exponent(exponent=20) == 20.0


def test_the_default_camera_sees_the_front_of_a_lone_square() -> None:
    camera = read(scene_with()).cameras["main"]
    assert camera.eye[2] > 0.0, "its front looks up"
    assert np.allclose(camera.target, [0.5, 0.5, 0.0])


def test_the_default_camera_of_a_closed_room_stands_inside() -> None:
    room = load_sample("cube_room")
    document = document_of(room)
    camera = scene_of(document.model_copy(update={"cameras": {}})).cameras["main"]
    corners = np.concatenate([o.world_vertices for o in room])
    assert np.all(camera.eye > corners.min(axis=0))
    assert np.all(camera.eye < corners.max(axis=0))


def test_an_empty_scene_is_a_scene() -> None:
    scene = parse_scene(b"{}")
    assert not scene.objects
    assert list(scene.cameras) == ["main"]


def test_limits_count_faces_and_corners() -> None:
    scene = read(scene_with())
    document = SceneDocument.model_validate(scene_with())
    SceneLimits(max_polygons=1, max_vertices=4).check(scene)
    SceneLimits(max_polygons=1, max_vertices=4).check_document(document)
    for limits in (SceneLimits(max_polygons=0), SceneLimits(max_vertices=3)):
        with pytest.raises(LimitExceededError):
            limits.check(scene)
        with pytest.raises(LimitExceededError):
            limits.check_document(document)


# --- settings ---


def test_settings_change_only_what_is_given() -> None:
    before = LightSettings(error_tolerance=0.1, minimum_area=0.5)
    after = SettingsDocument.model_validate({"error_tolerance": 0.01}).changes_to(before)
    assert after == LightSettings(error_tolerance=0.01, minimum_area=0.5)
    assert SettingsDocument.model_validate({"minimum_area": None}).changes_to(before).minimum_area is None


def test_settings_describe_themselves() -> None:
    settings = LightSettings(error_tolerance=0.1, max_links=77)
    document = SettingsDocument.describing(settings)
    assert document.changes_to(LightSettings()) == settings


@pytest.mark.parametrize(
    "given_settings",
    [
        {"error_tolerance": 0},
        {"error_tolerance": 1.5},
        {"error_tolerance": "0.1"},
        {"error_tolerance": None},
        {"max_elements": 0},
        {"max_elements": 1.5},
        {"max_links": 2**31},
        {"relative_cutoff": 1.0},
        {"tolerance": 0.1},
    ],
)
def test_bad_settings_are_refused(given_settings: dict[str, Any]) -> None:
    with pytest.raises(ValidationError) as refused:
        SettingsDocument.model_validate(given_settings)
    assert refused.value.errors()[0]["loc"] == tuple(given_settings)
