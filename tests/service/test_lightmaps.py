"""Lightmaps over HTTP: files with what is told of them, and what is refused."""

from __future__ import annotations

import io

import numpy as np
import OpenEXR
import pygltflib
import pytest
from fastapi.testclient import TestClient
from PIL import Image

from tests.service.conftest import open_box
from tests.service.problem import fields_at_fault, problem_of


@pytest.mark.parametrize("source", ["vpl", "radiosity"])
def test_every_format_is_of_the_same_picture(client: TestClient, settled: str, source: str) -> None:
    query = {"density": 6, "source": source}
    answers = {
        name: client.get(f"{settled}/lightmap", params=query | {"format": name})
        for name in ("glb", "exr", "png")
    }
    for answer in answers.values():
        assert answer.status_code == 200, answer.text
        assert answer.headers["x-revision"] == "1"
        assert answer.headers["x-converged"] == "true"
        assert float(answer.headers["x-error-estimate"]) <= 0.05
        assert float(answer.headers["x-texels-per-metre"]) == 6.0
        assert answer.headers["x-lightmap-size"] == answers["exr"].headers["x-lightmap-size"]
    width, height = map(int, answers["exr"].headers["x-lightmap-size"].split("x"))
    assert answers["exr"].headers["content-type"] == "image/x-exr"
    light = OpenEXR.File(io.BytesIO(answers["exr"].content)).channels()["RGB"].pixels
    assert light.shape == (height, width, 3)
    assert light.max() > 0.0
    with Image.open(io.BytesIO(answers["png"].content)) as picture:
        assert picture.size == (width, height)
        brightest = np.unravel_index(np.argmax(light[..., 0]), light.shape[:2])
        assert np.asarray(picture)[brightest][0] == 255
    assert answers["glb"].headers["content-type"] == "model/gltf-binary"
    file = pygltflib.GLTF2.load_from_bytes(answers["glb"].content)
    assert [node.name for node in file.nodes] == ["floor", "lamp", "crate"]
    assert all(mesh.primitives[0].attributes.TEXCOORD_1 is not None for mesh in file.meshes)
    assert file.images[0].mimeType == "image/png"
    told = file.scenes[0].extras["lightmap"]
    assert (told["width"], told["height"], told["source"]) == (width, height, source)
    assert told["white_irradiance"] == pytest.approx(float(answers["glb"].headers["x-white-irradiance"]))


def test_accept_chooses_and_white_can_be_given(client: TestClient, settled: str) -> None:
    answer = client.get(
        f"{settled}/lightmap", params={"density": 3, "white": 5}, headers={"Accept": "image/png"}
    )
    assert answer.headers["content-type"] == "image/png"
    assert answer.headers["vary"] == "Accept"
    assert float(answer.headers["x-white-irradiance"]) == 5.0
    default = client.get(f"{settled}/lightmap", params={"density": 3, "wait": "none"})
    assert default.headers["content-type"] == "model/gltf-binary"
    refused = client.get(f"{settled}/lightmap", headers={"Accept": "text/html"})
    problem_of(refused, 406)


@pytest.mark.parametrize("density", ["0", "-1", "nan", "inf", "many", "100000", "1e9", "1e10"])
def test_a_bad_density_is_named(client: TestClient, settled: str, density: str) -> None:
    answer = client.get(f"{settled}/lightmap", params={"density": density})
    assert fields_at_fault(answer) == [["query", "density"]]


@pytest.mark.parametrize(
    ("name", "value"), [("source", "sun"), ("format", "gif"), ("gather", "all"), ("white", "0"), ("hue", "1")]
)
def test_other_bad_parameters_are_named(client: TestClient, settled: str, name: str, value: str) -> None:
    answer = client.get(f"{settled}/lightmap", params={name: value})
    assert fields_at_fault(answer) == [["query", name]]


def test_time_that_is_up_ends_the_wait(client: TestClient, settled: str) -> None:
    query: dict[str, str | float] = {"density": 200, "format": "png", "timeout_ms": 0}
    problem = problem_of(client.get(f"{settled}/lightmap", params=query), 409)
    assert problem["type"] == "urn:halflight:not-ready"


def test_what_is_not_within_the_tolerance_in_time_says_so(client: TestClient) -> None:
    path = open_box(client, error_tolerance=1e-5)
    query: dict[str, str | float] = {"density": 20, "format": "png", "source": "vpl", "timeout_ms": 2000}
    answer = client.get(f"{path}/lightmap", params=query)
    assert answer.status_code == 200, answer.text
    assert answer.headers["x-converged"] == "false"
    assert client.delete(path).status_code == 204


def test_an_edit_is_in_the_next_lightmap(client: TestClient, session: str) -> None:
    edits = {"edits": [{"op": "remove", "id": "lamp"}]}
    assert client.post(f"{session}/edits", json=edits).status_code == 200
    answer = client.get(f"{session}/lightmap", params={"density": 4, "format": "exr"})
    assert answer.headers["x-revision"] == "2"
    assert OpenEXR.File(io.BytesIO(answer.content)).channels()["RGB"].pixels.max() == 0.0
