"""Exports: what the files hold is what the solution holds."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np
import pytest

from solver.document.conversion import scene_of
from solver.document.samples import parse_scene
from solver.engine.engine import Engine
from solver.engine.exports.files import ExportFormat, ExportRequest, Shading
from solver.engine.grids import GridRequest, csv_of, grid_of
from solver.errors import LimitExceededError, SceneError
from solver.formats.reading import SceneFormat, read_scene
from solver.formats.source import ReadOptions, SourceFile
from solver.geometry.scene import Scene
from solver.geometry.surfaces import flatten
from solver.types import AnyArray
from tests.engine.scenes import box, box_document


@pytest.fixture(scope="module")
def engine() -> Engine:
    made = Engine(box())
    while made.step(0.1):
        pass
    return made


@pytest.fixture
def export(engine: Engine) -> Callable[..., bytes]:
    def file(chosen: str, shading: Shading = Shading.LIGHT) -> bytes:
        return engine.export(ExportRequest(ExportFormat(chosen), shading)).content

    return file


def test_arrays_tell_the_power_that_leaves(engine: Engine, export: Callable[..., bytes]) -> None:
    with np.load(io.BytesIO(export("npz"))) as file:
        found = dict(file)
    assert list(found["object_ids"]) == ["floor", "lamp", "crate"]
    assert found["area"].sum() == pytest.approx(4 + 1 + 2 * 0.25)
    lamp = found["object"] == 1
    assert found["radiosity"][lamp].mean(axis=0) == pytest.approx([10, 10, 8])
    reflected = found["irradiance"] * np.array([[0.6, 0.4, 0.2], [0, 0, 0], [0.5, 0.5, 0.5]])[found["object"]]
    emitted = np.where(lamp[:, None], [10, 10, 8], 0)
    assert found["radiosity"] == pytest.approx(emitted + reflected, rel=1e-9)
    # The mean over a parallelogram of a linear function is the mean of its corners.
    quads = found["corner_count"] == 4
    means = found["corner_irradiance"][quads].mean(axis=1)
    bright = found["irradiance"][quads].max(axis=1) > 0.2 * found["irradiance"].max()
    assert means[bright] == pytest.approx(found["irradiance"][quads][bright], rel=0.05)
    assert found["error_estimate"] <= 0.02
    assert np.array_equal(found["side"].max(), 1), "the crate has two sides"


def test_vtk_holds_the_same(export: Callable[..., bytes]) -> None:
    with np.load(io.BytesIO(export("npz"))) as file:
        found = dict(file)
    root = ElementTree.fromstring(export("vtu"))

    def array(path: str, dtype: str) -> AnyArray:
        element = root.find(f"UnstructuredGrid/{path}")
        assert element is not None and element.text is not None
        length = int.from_bytes(base64.b64decode(element.text[:12]), "little")
        raw = base64.b64decode(element.text[12:])
        assert len(raw) == length
        columns = int(element.get("NumberOfComponents", 1))
        values = np.frombuffer(raw, dtype)
        return values.reshape(-1, columns) if columns > 1 else values

    assert np.array_equal(array("Piece/CellData/DataArray[@Name='radiosity']", "<f8"), found["radiosity"])
    assert np.array_equal(array("Piece/CellData/DataArray[@Name='object']", "<i4"), found["object"])
    points = array("Piece/Points/DataArray", "<f8")
    offsets = array("Piece/Cells/DataArray[@Name='offsets']", "<i8")
    assert offsets[-1] == len(points) == found["corner_count"].sum()
    assert np.array_equal(points[: offsets[0]], found["corners"][0][: found["corner_count"][0]])


def read(content: bytes) -> Scene:
    source = SourceFile("a.glb", content)
    return scene_of(read_scene(source, SceneFormat.GLB, ReadOptions()).document)


@pytest.mark.parametrize("shading", list(Shading))
def test_glb_comes_back_as_the_scene(engine: Engine, export: Callable[..., bytes], shading: Shading) -> None:
    before, after = engine.scene, read(export("glb", shading))
    assert list(after.objects) == list(before.objects)
    assert list(after.cameras) == list(before.cameras)
    old, new = flatten(before), flatten(after)
    # Elements are put together again: patches are those of the scene, not of the solution.
    assert new.patch_count == old.patch_count
    assert np.sort(new.area) == pytest.approx(np.sort(old.area), rel=1e-6)
    for each in before:
        twin = after.object(each.id).material
        assert np.array_equal(twin.reflectance, each.material.reflectance)
        assert np.array_equal(twin.emission, each.material.emission)
        assert twin.two_sided == each.material.two_sided


def test_json_is_the_scene_document(engine: Engine, export: Callable[..., bytes]) -> None:
    again = parse_scene(export("json"))
    assert list(again.objects) == list(engine.scene.objects)
    assert json.loads(export("json"))["name"] == "box"


def test_notes_of_a_scene_are_warnings() -> None:
    document = {**box_document(), "notes": ["Textures are averaged."]}
    engine = Engine(parse_scene(json.dumps(document).encode()))
    assert engine.status().warnings == ("Textures are averaged.",)
    assert json.loads(engine.export(ExportRequest(ExportFormat.JSON)).content)["notes"] == document["notes"]


def test_grids_lie_in_the_middles_of_cells(engine: Engine) -> None:
    grid = grid_of(engine.scene, GridRequest(spacing=0.5, object="floor", offset=0.1))
    assert len(grid.positions) == 16
    assert sorted(set(grid.positions[:, 0].round(9))) == [-0.75, -0.25, 0.25, 0.75]
    assert grid.positions[:, 2] == pytest.approx(0.1)
    assert grid.normals == pytest.approx(np.tile([0, 0, 1], (16, 1)))
    back = grid_of(engine.scene, GridRequest(spacing=0.5, object="floor", back=True))
    assert back.normals == pytest.approx(np.tile([0, 0, -1], (16, 1)))


def test_a_grid_in_a_plane_measures_what_a_probe_does(engine: Engine) -> None:
    request = GridRequest(spacing=1.0, origin=(-1, -1, 0), u=(2, 0, 0), v=(0, 2, 0))
    grid, result = engine.measure(request)
    lines = csv_of(grid, result).decode().splitlines()
    assert lines[0] == "face,x,y,z,nx,ny,nz,lux,irradiance_r,irradiance_g,irradiance_b,error_estimate"
    table = np.array([[float(word) for word in line.split(",")] for line in lines[1:]])
    assert table.shape == (4, 12)
    assert (table[:, 0] == -1).all()
    assert table[:, 1:4] == pytest.approx(grid.positions)
    probed = engine.probe(grid.positions, grid.normals)
    assert table[:, 7] == pytest.approx(probed.illuminance, rel=1e-8)
    assert table[:, 8:11] == pytest.approx(probed.irradiance, rel=1e-8)
    lit = table[:, 7]
    assert lit.min() > 0
    assert lit[:3] == pytest.approx(np.full(3, lit[0]), rel=0.05), "the crate shades the fourth alone"
    assert lit[3] < 0.9 * lit[0]


def test_concave_faces_are_measured_where_they_are() -> None:
    document = {
        "objects": [
            {
                "id": "ell",
                "mesh": {
                    "vertices": [[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]],
                    "faces": [[0, 1, 2, 3, 4, 5]],
                },
            }
        ]
    }
    scene = parse_scene(json.dumps(document).encode())
    grid = grid_of(scene, GridRequest(spacing=0.25, object="ell"))
    assert len(grid.positions) == 48
    assert not ((grid.positions[:, 0] > 1) & (grid.positions[:, 1] > 1)).any()


@pytest.mark.parametrize(
    ("request_", "location"),
    [
        (GridRequest(0.5), ("origin",)),
        (GridRequest(0.5, object="nothing"), ("object",)),
        (GridRequest(0.5, object="floor", face=3), ("face",)),
        (GridRequest(0.5, object="floor", u=(1, 0, 0)), ("origin",)),
        (GridRequest(0.5, origin=(0, 0, 0), u=(1, 0, 0)), ("v",)),
        (GridRequest(0.5, origin=(0, 0, 0), u=(1, 0, 0), v=(2, 0, 0)), ("v",)),
        (GridRequest(0.5, face=0, origin=(0, 0, 0), u=(1, 0, 0), v=(0, 1, 0)), ("face",)),
    ],
)
def test_faults_of_grids_are_named(engine: Engine, request_: GridRequest, location: tuple[str]) -> None:
    with pytest.raises(SceneError) as refused:
        engine.measure(request_)
    assert refused.value.location == location


def test_grids_have_a_limit(engine: Engine) -> None:
    for spacing in (0.01, 1e-9, 1e-300):
        with pytest.raises(LimitExceededError):
            engine.measure(GridRequest(spacing, object="floor"))
