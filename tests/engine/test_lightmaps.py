"""Lightmaps of sessions: against closed forms, by both kinds of light, and as files that load."""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import OpenEXR
import pygltflib
import pytest
from PIL import Image

from solver.engine.engine import Engine
from solver.engine.lightmaps.bake import Bake, Gather, Lightmap, LightmapRequest, LightmapSource
from solver.engine.lightmaps.files import LightmapFormat, encode_lightmap, white_of
from solver.engine.overlays.base import NotReadyError
from solver.engine.status import SessionState
from solver.errors import SceneError
from solver.geometry.scene import Material, Mesh, Scene, SceneObject
from solver.illumination.settings import LightSettings
from solver.rendering.tone_mapping import srgb_to_linear
from solver.transport.lambert import points_to_polygon
from solver.types import AnyArray, FloatArray
from tests.engine.acting import edits
from tests.engine.showing import room

FINE = LightSettings(error_tolerance=0.01)
RADIOSITY = LightmapSource.RADIOSITY


def begin(engine: Engine, request: LightmapRequest) -> Bake:
    while (made := engine.bake(request)) is None:
        assert engine.step(0.1), "what is missing is worked on"
    return made


def bake(engine: Engine, request: LightmapRequest) -> Lightmap:
    made = begin(engine, request)
    while made.step(0.1):
        assert 0.0 <= made.progress <= 1.0
    assert made.progress == 1.0
    return made.lightmap()


def lit(lightmap: Lightmap) -> FloatArray:
    """(n, 3) W/m2 of all texels."""
    return lightmap.irradiance.reshape(-1, 3)[lightmap.texels.pixel].astype(np.float64)


def quad(*corners: tuple[float, float, float]) -> Mesh:
    return Mesh(np.array(corners, dtype=np.float64), ((0, 1, 2, 3),))


def plates() -> Scene:
    """A black floor under a lamp: all light is direct."""
    floor = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    lamp = quad((-0.4, -0.3, 1), (-0.4, 0.3, 1), (0.4, 0.3, 1), (0.4, -0.3, 1))
    objects = (
        SceneObject("floor", floor, Material(np.zeros(3), np.zeros(3))),
        SceneObject("lamp", lamp, Material(np.zeros(3), np.array([10.0, 6.0, 3.0]))),
    )
    return Scene({o.id: o for o in objects})


@pytest.fixture(scope="module")
def settled() -> Engine:
    """The room with a screen and a triangle; not to be edited."""
    return Engine(room(), FINE)


# --- light ---


@pytest.mark.parametrize(
    ("wanted", "most"),
    [
        (LightmapRequest(12.0), 0.02),
        (LightmapRequest(12.0, RADIOSITY, Gather.EXACT), 1e-3),
    ],
)
def test_light_of_a_lamp_is_that_of_form_factors(wanted: LightmapRequest, most: float) -> None:
    engine = Engine(plates(), FINE)
    lightmap = bake(engine, wanted)
    texels, light = lightmap.texels, lit(lightmap)
    floor = texels.patch == 0
    position = texels.position[floor]
    assert len(position) == 25 * 25
    lamp = lightmap.world.surfaces.corners[1]
    normals = np.broadcast_to([0.0, 0.0, 1.0], position.shape)
    factor = points_to_polygon(position, normals, lamp)
    exact = factor[:, None] * np.array([10.0, 6.0, 3.0])
    assert lightmap.converged
    error = np.linalg.norm(light[floor] - exact) / np.linalg.norm(exact)
    assert error <= most
    assert error <= max(2.0 * lightmap.error_estimate, most / 2)
    assert np.all(light[~floor] == 0.0)


def test_both_kinds_of_light_agree(settled: Engine) -> None:
    by_lights = bake(settled, LightmapRequest(9.0))
    exact = bake(settled, LightmapRequest(9.0, RADIOSITY, Gather.EXACT))
    quick = bake(settled, LightmapRequest(9.0, RADIOSITY, Gather.SOLUTION))
    np.testing.assert_array_equal(by_lights.texels.pixel, exact.texels.pixel)
    assert (exact.method, quick.method) == ("exact", "solution")
    assert by_lights.method.endswith("paths")
    patch = exact.texels.patch
    count = len(settled.scene.objects) * 2
    means = [
        np.bincount(patch, lit(m)[:, 1], count) / np.maximum(np.bincount(patch, minlength=count), 1)
        for m in (exact, by_lights, quick)
    ]
    assert np.abs(means[1] - means[0]).max() <= 0.03 * means[0].max()
    assert np.abs(means[2] - means[0]).max() <= 0.03 * means[0].max()
    for other in (by_lights, quick):
        apart = np.linalg.norm(lit(other) - lit(exact)) / np.linalg.norm(lit(exact))
        assert apart <= 0.03


def test_few_texels_are_gathered_and_many_are_not(settled: Engine) -> None:
    assert bake(settled, LightmapRequest(4.0, RADIOSITY)).method == "exact"
    assert bake(settled, LightmapRequest(120.0, RADIOSITY)).method == "solution"


def test_what_there_is_can_be_had_before_the_end(settled: Engine) -> None:
    for request in (LightmapRequest(5.0), LightmapRequest(20.0, RADIOSITY)):
        made = begin(settled, request)
        assert not made.is_drawable
        while not made.is_drawable:
            made.step(1e-9)
        assert not made.is_over
        early = made.lightmap()
        assert not early.converged
        while made.step(0.1):
            pass
        final = made.lightmap()
        assert final.converged
        assert final.error_estimate <= early.error_estimate
        apart = np.linalg.norm(lit(early) - lit(final)) / np.linalg.norm(lit(final))
        assert apart < 0.5


def test_an_edit_leaves_a_lightmap_as_it_was() -> None:
    engine = Engine(plates(), FINE)
    made = begin(engine, LightmapRequest(6.0))
    engine.apply(edits({"op": "remove", "id": "lamp"}))
    while made.step(0.1):
        pass
    assert made.lightmap().revision == 1
    assert lit(made.lightmap()).max() > 0.0
    dark = bake(engine, LightmapRequest(6.0))
    assert (dark.revision, lit(dark).max()) == (2, 0.0)
    assert white_of(dark) == 1.0


def test_a_failed_solution_has_no_lightmap(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = Engine(plates(), FINE)
    monkeypatch.setattr(type(engine._solution), "state", SessionState.FAILED)
    with pytest.raises(NotReadyError):
        engine.bake(LightmapRequest(source=RADIOSITY))
    assert engine.bake(LightmapRequest()) is not None


def test_too_many_texels_are_refused() -> None:
    made = begin(Engine(plates(), FINE), LightmapRequest(1e4))
    with pytest.raises(SceneError) as refused:
        made.step(1.0)
    assert refused.value.location == ("density",)


# --- files ---


def test_linear_file_has_the_irradiance(settled: Engine) -> None:
    lightmap = bake(settled, LightmapRequest(8.0, RADIOSITY))
    content = encode_lightmap(lightmap, LightmapFormat.EXR, 1.0)
    pixels = OpenEXR.File(io.BytesIO(content)).channels()["RGB"].pixels
    np.testing.assert_array_equal(pixels, lightmap.irradiance)


def test_scene_file_has_the_lightmap_on_it(settled: Engine) -> None:
    lightmap = bake(settled, LightmapRequest(10.0, RADIOSITY))
    white = white_of(lightmap)
    content = encode_lightmap(lightmap, LightmapFormat.GLB, white)
    length, kind = struct.unpack("<II", content[12:20])
    assert (content[:4], struct.unpack("<I", content[8:12])[0], kind) == (b"glTF", len(content), 0x4E4F534A)
    told = json.loads(content[20 : 20 + length])
    assert told["scenes"][0]["extras"]["lightmap"]["white_irradiance"] == white
    assert told["scenes"][0]["extras"]["lightmap"]["texels_per_metre"] == 10.0
    file = pygltflib.GLTF2.load_from_bytes(content)
    blob = file.binary_blob()

    def read(number: int) -> AnyArray:
        accessor = file.accessors[number]
        view = file.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor.type]
        kind = np.uint32 if width == 1 else np.float32
        assert view.byteOffset % 4 == 0
        part = blob[view.byteOffset : view.byteOffset + view.byteLength]
        data = np.frombuffer(part, dtype=kind).reshape(-1, width)
        assert len(data) == accessor.count
        return data

    picture_view = file.bufferViews[file.images[0].bufferView]
    start = picture_view.byteOffset
    with Image.open(io.BytesIO(blob[start : start + picture_view.byteLength])) as picture:
        assert picture.size == (lightmap.atlas.width, lightmap.atlas.height)
        texture = white * srgb_to_linear(np.asarray(picture) / 255.0)
    surfaces = lightmap.world.surfaces
    assert [node.name for node in file.nodes] == list(surfaces.object_ids)
    area = 0.0
    for mesh in file.meshes:
        (primitive,) = mesh.primitives
        position, uv = read(primitive.attributes.POSITION), read(primitive.attributes.TEXCOORD_1)
        metres, indices = read(primitive.attributes.TEXCOORD_0), read(primitive.indices).ravel()
        assert len(position) == len(uv) == len(metres)
        assert np.all((uv > 0.0) & (uv < 1.0))
        corner = position[indices].reshape(-1, 3, 3)
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        area += 0.5 * float(np.linalg.norm(normal, axis=1).sum())
        given = read(primitive.attributes.NORMAL)[indices].reshape(-1, 3, 3)[:, 0]
        assert np.all(np.einsum("na,na->n", normal, given) > 0.0)
        flat = metres[indices].reshape(-1, 3, 2)
        sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
        np.testing.assert_allclose(np.linalg.norm(flat - np.roll(flat, 1, axis=1), axis=2), sides, atol=1e-5)
        material = file.materials[primitive.material]
        assert "KHR_materials_unlit" in material.extensions
        base = material.pbrMetallicRoughness
        if mesh.name == "lamp":
            assert base.baseColorTexture is None
        else:
            assert base.baseColorTexture.texCoord == 1
            np.testing.assert_allclose(base.baseColorFactor[:3], material.extras["reflectance"])
    assert area == pytest.approx(float(surfaces.area.sum()), rel=1e-5)
    # The texture holds the light, to the steps of a byte.
    light = np.minimum(lightmap.irradiance, white)
    assert np.abs(texture - light).max() <= 0.005 * white


def test_a_scene_without_surfaces_can_be_baked() -> None:
    lightmap = bake(Engine(Scene({}), FINE), LightmapRequest())
    for chosen in LightmapFormat:
        assert encode_lightmap(lightmap, chosen, white_of(lightmap))
