"""glTF: units, materials, nodes, cameras, lights; what is refused and where."""

from __future__ import annotations

import base64
import io
import json
import math
from typing import Any

import numpy as np
import pytest
from PIL import Image

from solver.document.limits import SceneLimits
from solver.document.samples import load_sample, sample_names
from solver.errors import LimitExceededError, SceneError
from solver.formats.gltf.writer import scene_glb
from solver.geometry.surfaces import flatten
from tests.formats.making import (
    EFFICACY,
    SQUARE,
    TWO_TRIANGLES,
    GlbFile,
    areas,
    gltf_json,
    lumens,
    read,
    scene,
    square_glb,
)

GREY = {"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.3, 0.4, 1], "metallicFactor": 0}}


def material_of(material: dict[str, Any]) -> Any:
    imported = read(square_glb(material).bytes(), "glb")
    return imported.document.objects[0].material, imported.warnings


def png(pixels: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.array(pixels, dtype=np.uint8)).save(file, "PNG")
    return file.getvalue()


def test_a_square_of_two_triangles_is_one_face() -> None:
    imported = read(square_glb(GREY, name="table").bytes(), "glb")
    (table,) = imported.document.objects
    assert table.id == "table"
    assert len(table.mesh.faces) == 1
    assert areas(imported) == {"table": pytest.approx(1.0)}
    assert table.material.reflectance == pytest.approx([0.2, 0.3, 0.4])
    assert imported.warnings == ()
    assert len(read(square_glb(GREY).bytes(), "glb", merge=False).document.objects[0].mesh.faces) == 2


def test_emission_is_luminance() -> None:
    found, _ = material_of(
        {
            "emissiveFactor": [1, 0.5, 0.25],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1000}},
        }
    )
    assert found.emission == pytest.approx([math.pi * 1000 * f / EFFICACY for f in (1, 0.5, 0.25)])


def test_metals_are_specular_unless_they_are_rough() -> None:
    def metal(roughness: float) -> Any:
        model = {"baseColorFactor": [0.8, 0.6, 0.4, 1], "metallicFactor": 1, "roughnessFactor": roughness}
        return material_of({"pbrMetallicRoughness": model})[0]

    assert metal(0.0).exponent is None
    assert metal(0.0).specular == [0.8, 0.6, 0.4]
    assert metal(0.0).reflectance == [0, 0, 0]
    assert metal(0.4).exponent == pytest.approx(0.25 * (2 / 0.16**2 - 2))
    assert metal(1.0).specular == [0, 0, 0]
    assert metal(1.0).reflectance == [0.8, 0.6, 0.4]


def test_white_is_bounded_with_a_warning() -> None:
    found, warnings = material_of({"pbrMetallicRoughness": {"metallicFactor": 0}})
    assert found.reflectance == [0.95] * 3
    assert warnings == ("What reflects more than 0.95 of a channel is made to reflect that.",)


def test_double_sided_is_two_sided() -> None:
    assert material_of({**GREY, "doubleSided": True})[0].two_sided
    assert not material_of(GREY)[0].two_sided


def textured(pixels: Any, uv: Any) -> GlbFile:
    file = GlbFile()
    file.add(SQUARE, TWO_TRIANGLES, {})
    file.file["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = file.array(
        np.array(uv, dtype="<f4"), 5126, "VEC2"
    )
    file.file["images"] = [{"bufferView": file.view(png(pixels)), "mimeType": "image/png"}]
    file.file["textures"] = [{"source": 0}]
    file.file["materials"] = [
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}
    ]
    return file


def test_textures_are_averaged_in_linear_light() -> None:
    checks = np.zeros((64, 64, 3))
    checks[(np.add.outer(range(64), range(64)) // 2) % 2 == 0] = 188
    imported = read(textured(checks, [[0, 0], [1, 0], [1, 1], [0, 1]]).bytes(), "glb")
    (square,) = imported.document.objects
    assert square.material.reflectance == pytest.approx([0.5 * 0.5029] * 3, rel=0.03)
    assert "averaged" in imported.warnings[0]


def test_a_palette_makes_objects_of_one_colour_each() -> None:
    file = textured([[[188, 0, 0], [0, 0, 188]]], [[0.1, 0.5]] * 4)
    palette = np.array([[0.1, 0.5]] * 3 + [[0.9, 0.5]] * 3, dtype="<f4")
    primitive = file.file["meshes"][0]["primitives"][0]
    primitive["attributes"] = {
        "POSITION": file.points([SQUARE[k] for k in TWO_TRIANGLES]),
        "TEXCOORD_0": file.array(palette, 5126, "VEC2"),
    }
    primitive["indices"] = file.indices(range(6))
    file.file["nodes"][0]["name"] = "toy"
    imported = read(file.bytes(), "glb")
    found = {o.id: o.material.reflectance for o in imported.document.objects}
    assert sorted(found) == ["toy", "toy.2"]
    assert sorted(found.values()) == [
        pytest.approx([0, 0, 0.5029], abs=1e-3),
        pytest.approx([0.5029, 0, 0], abs=1e-3),
    ]
    assert areas(imported) == {"toy": pytest.approx(0.5), "toy.2": pytest.approx(0.5)}


def test_nodes_are_placed_and_named_apart() -> None:
    file = square_glb(GREY, name="leaf")
    file.file["nodes"] = [
        {"name": "tree", "children": [1, 2], "translation": [0, 0, 5], "scale": [2, 2, 2]},
        {"name": "leaf", "mesh": 0, "rotation": [math.sqrt(0.5), 0, 0, math.sqrt(0.5)]},
        {"name": "leaf", "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1]},
    ]
    imported = read(file.bytes(), "glb")
    objects = scene(imported).objects
    assert list(objects) == ["leaf", "leaf.2"]
    # Scaled by 2, and lifted by 5 after that: the first stands upright, the second lies at x = 6.
    assert sorted(map(tuple, objects["leaf"].world_vertices.round(6).tolist())) == [
        (0, 0, 5), (0, 0, 7), (2, 0, 5), (2, 0, 7),
    ]  # fmt: skip
    assert objects["leaf.2"].world_vertices[:, 0].min() == pytest.approx(6)
    assert sum(areas(imported).values()) == pytest.approx(8)


def test_cameras_look_along_minus_z() -> None:
    file = square_glb(GREY)
    file.file["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 2.0}}]
    file.file["nodes"].append({"name": "eye", "camera": 0, "translation": [0.5, 0.5, 3]})
    camera = read(file.bytes(), "glb").document.cameras["eye"]
    assert camera.eye == pytest.approx([0.5, 0.5, 3])
    assert camera.target == pytest.approx([0.5, 0.5, 0])
    assert camera.up == pytest.approx([0, 1, 0])
    assert camera.vertical_fov == pytest.approx(math.degrees(1.0))
    assert camera.width == 2 * camera.height


def test_without_cameras_y_is_up() -> None:
    camera = read(square_glb(GREY).bytes(), "glb").document.cameras["main"]
    assert camera.up == [0, 1, 0]


def lit(light: dict[str, Any], **node: Any) -> Any:
    file = square_glb(GREY, name="square")
    file.file["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    file.file["nodes"].append({"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}, **node})
    return read(file.bytes(), "glb")


def test_a_point_light_gives_its_lumens() -> None:
    imported = lit({"type": "point", "intensity": 80.0}, translation=[0, 0, 2])
    assert lumens(imported, "lamp") == pytest.approx(4 * math.pi * 80)
    assert "point lights are balls" in imported.warnings[0].lower()


def test_a_spot_light_gives_the_lumens_of_its_cone() -> None:
    light = {"type": "spot", "intensity": 100.0, "spot": {"innerConeAngle": 0.4, "outerConeAngle": 0.4001}}
    imported = lit(light, translation=[0, 0, 2])
    assert lumens(imported, "lamp") == pytest.approx(100 * 2 * math.pi * (1 - math.cos(0.4)), rel=1e-2)
    (lamp,) = (o for o in imported.document.objects if o.id == "lamp")
    assert lamp.material.emission_exponent > 10
    surfaces = flatten(scene(imported))
    assert surfaces.normal[surfaces.emission.any(axis=1)] == pytest.approx(np.array([[0, 0, -1]]))


def test_a_directional_light_gives_its_lux() -> None:
    imported = lit({"type": "directional", "intensity": 500.0, "color": [1, 1, 0.5]})
    surfaces = flatten(scene(imported))
    (sun,) = np.flatnonzero(surfaces.emission.any(axis=1))
    middle = np.array([0.5, 0.5, 0.0])
    away = surfaces.corners[sun].mean(axis=0) - middle
    distance = np.linalg.norm(away)
    assert away / distance == pytest.approx([0, 0, 1])
    lux = EFFICACY * surfaces.emission[sun] * surfaces.area[sun] / (math.pi * distance**2)
    assert lux == pytest.approx([500, 500, 250])
    eye = np.array(imported.document.cameras["main"].eye)
    assert np.linalg.norm(eye - middle) < 5, "the camera looks at the square, not at the sun"


def test_strips_fans_and_plain_lists() -> None:
    for mode, order in ((4, TWO_TRIANGLES), (5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])):
        file = square_glb(GREY, name="a")
        primitive = file.file["meshes"][0]["primitives"][0]
        primitive["mode"], primitive["indices"] = mode, file.indices(order)
        surfaces = flatten(scene(read(file.bytes(), "glb")))
        assert surfaces.normal == pytest.approx(np.array([[0, 0, 1]]))
        assert surfaces.area == pytest.approx([1.0])


def test_sparse_and_normalized_accessors() -> None:
    file = square_glb(GREY, name="a", scale=[2, 2, 2])
    flat = np.array([[0, 0, 0], [32767, 0, 0], [0, 0, 0], [0, 32767, 0]], "<i2")
    file.file["accessors"][0] |= {
        "componentType": 5122, "normalized": True,
        "bufferView": file.view(flat.tobytes()),
        "sparse": {
            "count": 1,
            "indices": {"bufferView": file.view(b"\x02"), "componentType": 5121},
            "values": {"bufferView": file.view(np.array([32767, 32767, 0], "<i2").tobytes())},
        },
    }  # fmt: skip
    assert areas(read(file.bytes(), "glb")) == {"a": pytest.approx(4.0)}


def test_json_with_data_uris() -> None:
    points = np.array(SQUARE, dtype="<f4").tobytes()
    file = gltf_json(
        buffers=[{"byteLength": 48, "uri": "data:;base64," + base64.b64encode(points).decode()}],
        bufferViews=[{"buffer": 0, "byteLength": 48}],
        accessors=[{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}],
        meshes=[{"name": "fan", "primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}],
        nodes=[{"mesh": 0}],
    )
    assert areas(read(json.dumps(file), "gltf")) == {"fan": pytest.approx(1.0)}


def first(file: dict[str, Any]) -> Any:
    return file["meshes"][0]["primitives"][0]


@pytest.mark.parametrize(
    ("change", "location"),
    [
        (lambda f: f.update(asset={"version": "1.0"}), ("asset", "version")),
        (lambda f: f["accessors"][0].update(count=5), ("accessors", 0)),
        (lambda f: f["accessors"][0].update(type="VEC2"), ("accessors", 0, "type")),
        (lambda f: f["accessors"][0].update(componentType=1), ("accessors", 0, "componentType")),
        (lambda f: f["accessors"][0].update(byteOffset=-4), ("accessors", 0, "byteOffset")),
        (lambda f: f["bufferViews"][0].update(byteLength=10**6), ("bufferViews", 0, "byteLength")),
        (lambda f: f["bufferViews"][0].update(buffer=3), ("bufferViews", 0, "buffer")),
        (lambda f: f["bufferViews"][0].update(byteStride=4), ("bufferViews", 0, "byteStride")),
        (lambda f: first(f).update(indices=9), ("meshes", 0, "primitives", 0, "indices")),
        (lambda f: first(f).update(material=9), ("meshes", 0, "primitives", 0, "material")),
        (lambda f: f["nodes"][0].update(mesh=9), ("nodes", 0, "mesh")),
        (lambda f: f["nodes"][0].update(children=[0]), ("nodes",)),
        (lambda f: f["nodes"][0].update(scale=[1, 1]), ("nodes", 0, "scale")),
        (lambda f: f["nodes"][0].update(matrix=[math.inf] * 16), ("nodes", 0, "matrix", 0)),
        (lambda f: f.update(extensionsRequired=["KHR_draco_mesh_compression"]), ("extensionsRequired", 0)),
        (lambda f: f.update(scene=4, scenes=[{}]), ("scene",)),
        (lambda f: f["nodes"].clear(), ()),
        (lambda f: f["materials"][0].update(emissiveTexture={"index": 7}), ("materials", 0)),
    ],
)  # fmt: skip
def test_faults_are_named(change: Any, location: tuple[Any, ...]) -> None:
    file = square_glb({"pbrMetallicRoughness": {}})
    change(file.file)
    with pytest.raises(SceneError) as refused:
        read(file.bytes(), "glb")
    assert refused.value.location[: len(location)] == location


def test_indices_beyond_the_vertices_are_named() -> None:
    file = GlbFile()
    file.add(SQUARE, [0, 1, 4])
    with pytest.raises(SceneError, match="no vertex 4"):
        read(file.bytes(), "glb")


def test_arrays_without_bytes_have_a_limit() -> None:
    file = square_glb()
    file.file["accessors"][0] = {"componentType": 5126, "count": 2**30, "type": "VEC3"}
    with pytest.raises(LimitExceededError):
        read(file.bytes(), "glb")


def test_copies_count() -> None:
    file = square_glb()
    file.file["nodes"] = [{"mesh": 0}] * 30
    with pytest.raises(LimitExceededError, match="polygons"):
        read(file.bytes(), "glb", limits=SceneLimits(max_polygons=20))


@pytest.mark.parametrize("name", sample_names())
def test_what_is_written_is_read_again(name: str) -> None:
    before = load_sample(name)
    imported = read(scene_glb(before, {}), "glb", merge=False)
    after = scene(imported)
    assert imported.warnings == ()
    assert list(after.objects) == list(before.objects)
    assert list(after.cameras) == list(before.cameras)
    old, new = flatten(before), flatten(after)
    assert np.array_equal(new.corner_count, old.corner_count)
    assert np.abs(new.corners - old.corners).max() < 1e-6 * old.size
    merged = flatten(scene(read(scene_glb(before, {}), "glb")))
    assert merged.patch_count <= old.patch_count
    assert merged.area.sum() == pytest.approx(old.area.sum(), rel=1e-6)
    assert new.area.sum() == pytest.approx(old.area.sum(), rel=1e-6)
    for each in before:
        twin = after.object(each.id)
        assert np.array_equal(twin.material.reflectance, each.material.reflectance)
        assert np.array_equal(twin.material.emission, each.material.emission)
        assert twin.material.exponent == each.material.exponent
        assert twin.material.two_sided == each.material.two_sided
        assert np.array_equal(twin.transform.matrix, each.transform.matrix)
    for title, camera in before.cameras.items():
        twin_camera = after.cameras[title]
        assert twin_camera.eye == pytest.approx(camera.eye)
        assert twin_camera.target == pytest.approx(camera.target)
        assert twin_camera.vertical_fov == pytest.approx(camera.vertical_fov)
        assert (twin_camera.width, twin_camera.height) == (camera.width, camera.height)


def test_what_is_written_means_the_same_to_others() -> None:
    """Without the numbers of its own in `extras`, a written scene is read as other programs read it."""
    import pygltflib

    before = load_sample("cornell")
    file = pygltflib.GLTF2.load_from_bytes(scene_glb(before, {}))
    for material in file.materials:
        material.extras = {}
    after = scene(read(b"".join(file.save_to_bytes()), "glb"))
    for each in before:
        twin = after.object(each.id).material
        assert twin.reflectance == pytest.approx(each.material.reflectance)
        assert twin.emission == pytest.approx(each.material.emission)
