"""Exports and grids over HTTP."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from tests.service.problem import fields_at_fault, problem_of


@pytest.mark.parametrize(
    ("chosen", "media", "magic"),
    [
        ("glb", "model/gltf-binary", b"glTF"),
        ("npz", "application/x-npz", b"PK"),
        ("vtu", "application/vnd.vtk.vtu+xml", b"<?xml"),
        ("json", "application/json", b"{"),
    ],
)
def test_every_file(client: TestClient, settled: str, chosen: str, media: str, magic: bytes) -> None:
    answer = client.get(f"{settled}/export", params={"format": chosen, "wait": "converged"})
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith(media)
    assert answer.headers["content-disposition"].endswith(f'.{chosen}"')
    assert answer.headers["x-converged"] == "true"
    assert answer.headers["x-revision"] == "1"
    assert answer.content.startswith(magic)


def test_what_is_exported_opens_an_equal_session(client: TestClient, settled: str) -> None:
    fine = {"error_tolerance": 0.01}
    before = client.get(f"{settled}/scene").json()["scene"]
    twin = client.post("/v1/sessions", json={"scene": before, "settings": fine}).headers["location"]
    for shading in ("light", "materials"):
        content = client.get(f"{settled}/export", params={"shading": shading}).content
        answer = client.post(
            "/v1/sessions",
            content=content,
            headers={"Content-Type": "model/gltf-binary"},
            params={"settings": json.dumps(fine)},
        )
        path = answer.headers["location"]
        after = client.get(f"{path}/scene").json()["scene"]
        assert [o["id"] for o in after["objects"]] == [o["id"] for o in before["objects"]]
        assert [o["material"] for o in after["objects"]] == [o["material"] for o in before["objects"]]
        frames = []
        for place in (twin, path):
            query = {"wait": "converged", "format": "npy", "renderer": "gouraud"}
            frames.append(np.load(io.BytesIO(client.get(f"{place}/frame", params=query).content)))
        assert np.abs(frames[0] - frames[1]).mean() < 0.02 * frames[0].mean()
        assert client.delete(path).status_code == 204
    assert client.delete(twin).status_code == 204


def test_arrays_hold_the_solution(client: TestClient, settled: str) -> None:
    answer = client.get(f"{settled}/export", params={"format": "npz", "wait": "converged"})
    with np.load(io.BytesIO(answer.content)) as file:
        assert len(file["area"]) == client.get(settled).json()["statistics"]["leaves"]
        assert list(file["object_ids"]) == ["floor", "lamp", "crate"]


def test_a_grid_is_a_table(client: TestClient, settled: str) -> None:
    query: dict[str, Any] = {"object": "floor", "spacing": 0.5, "wait": "converged"}
    answer = client.get(f"{settled}/grid", params=query)
    assert answer.headers["content-type"].startswith("text/csv")
    lines = answer.text.splitlines()
    assert len(lines) == 17
    table = [[float(word) for word in line.split(",")] for line in lines[1:]]
    points = [{"position": row[1:4], "normal": row[4:7]} for row in table]
    probed = client.post(f"{settled}/probe", json={"points": points}).json()
    assert [row[7] for row in table] == pytest.approx(probed["illuminance"], rel=1e-6)
    plane = {"origin": "-1,-1,0.8", "u": "2,0,0", "v": "0,2,0", "spacing": 1}
    assert len(client.get(f"{settled}/grid", params=plane).text.splitlines()) == 5


@pytest.mark.parametrize(
    ("query", "location"),
    [
        ({}, ["query", "spacing"]),
        ({"spacing": 1}, ["query", "origin"]),
        ({"spacing": 0, "object": "floor"}, ["query", "spacing"]),
        ({"spacing": 1, "object": "x"}, ["query", "object"]),
        ({"spacing": 1, "object": "floor", "face": 9}, ["query", "face"]),
        ({"spacing": 1, "origin": "0,0", "u": "1,0,0", "v": "0,1,0"}, ["query", "origin"]),
        ({"spacing": 1, "origin": "0,0,0", "u": "1,0,0", "v": "1,0,0"}, ["query", "v"]),
    ],
)
def test_faults_of_grids_are_named(
    client: TestClient, settled: str, query: dict[str, Any], location: list[str]
) -> None:
    assert fields_at_fault(client.get(f"{settled}/grid", params=query)) == [location]


def test_grids_have_the_limit_of_probes(client: TestClient, settled: str) -> None:
    problem_of(client.get(f"{settled}/grid", params={"object": "floor", "spacing": 0.001}), 413)


def test_faults_of_exports_are_named(client: TestClient, settled: str) -> None:
    assert fields_at_fault(client.get(f"{settled}/export?format=doc")) == [["query", "format"]]
