"""Sessions on files of other formats, and their objects for sessions that are there."""

from __future__ import annotations

import json
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from solver.document.samples import load_sample
from solver.formats.gltf.writer import scene_glb
from tests.formats.making import binary_stl, ies, square_glb
from tests.formats.test_archives import packed
from tests.formats.test_fuzz import SOUND
from tests.formats.test_mgf import WALL
from tests.formats.test_obj_and_stl import CUBE, MTL, OBJ
from tests.service.apps import app_client
from tests.service.problem import fields_at_fault, problem_of

GLB = "model/gltf-binary"


def post(
    client: TestClient, content: bytes, media: str, place: str = "/v1/sessions", **query: Any
) -> httpx.Response:
    answer: httpx.Response = client.post(
        place, content=content, headers={"Content-Type": media}, params=query
    )
    return answer


def ended(client: TestClient, answer: httpx.Response) -> dict[str, Any]:
    """The status of a session that was opened, and is ended."""
    assert answer.status_code == 201, answer.text
    assert client.delete(answer.headers["location"]).status_code == 204
    status: dict[str, Any] = answer.json()
    return status


def test_a_session_on_a_glb(client: TestClient) -> None:
    content = scene_glb(load_sample("cornell"), {})
    query: dict[str, Any] = {"settings": json.dumps({"error_tolerance": 0.3}), "name": "a box", "scale": 2.0}
    answer = post(client, content, GLB, **query)
    path = answer.headers["location"]
    scene = client.get(f"{path}/scene").json()["scene"]
    frame = client.get(f"{path}/frame", params={"width": 16, "height": 16, "wait": "converged"})
    assert frame.status_code == 200
    status = ended(client, answer)
    assert status["name"] == scene["name"] == "a box"
    assert status["settings"]["error_tolerance"] == 0.3
    assert [o["id"] for o in scene["objects"]] == list(load_sample("cornell").objects)
    assert scene["cameras"]["main"]["eye"] == pytest.approx(2 * load_sample("cornell").cameras["main"].eye)


def test_what_could_not_be_kept_is_among_the_warnings(client: TestClient) -> None:
    answer = post(client, square_glb({}).bytes(), GLB)
    path = answer.headers["location"]
    client.post(f"{path}/edits", json={"edits": [{"op": "remove", "id": "node 0"}]})
    later = client.get(path).json()
    for status in (ended(client, answer), later):
        assert "What reflects more than 0.95 of a channel is made to reflect that." in status["warnings"]


@pytest.mark.parametrize(
    ("media", "content", "query", "objects"),
    [
        ("model/obj", OBJ.replace("/1", "").replace("/2", "").encode(), {}, ["floor", "lamp", "gable"]),
        ("model/stl; charset=utf-8", binary_stl(CUBE), {"two_sided": True}, ["scene"]),
        ("text/x-mgf", WALL.encode(), {}, ["wall"]),
        ("model/x-ies", ies(np.arange(0, 91, 10), np.ones(10)).encode(), {}, ["DOWNLIGHT"]),
        ("application/octet-stream", WALL.encode(), {"format": "mgf"}, ["wall"]),
        ("application/zip", packed(("m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")), {}, ["m"]),
    ],
)  # fmt: skip
def test_every_format(
    client: TestClient, media: str, content: bytes, query: dict[str, Any], objects: list[str]
) -> None:
    answer = post(client, content, media, "/v1/convert", **query)
    assert answer.status_code == 200, answer.text
    found = answer.json()["scene"]["objects"]
    assert [o["id"] for o in found] == objects
    ended(client, post(client, content, media, **query))
    # What was converted is a scene document like any other.
    document = {k: v for k, v in answer.json()["scene"].items() if k != "notes"}
    ended(client, client.post("/v1/sessions", json={"scene": document}))


def test_a_luminaire_is_added_to_a_session(client: TestClient, session: str) -> None:
    file = ies(np.arange(0, 91, 10), np.cos(np.radians(np.arange(0, 91, 10))))
    answer = post(client, file.encode(), "text/x-ies", "/v1/convert")
    assert "lm downwards" in answer.json()["warnings"][0]
    (lamp,) = answer.json()["scene"]["objects"]
    lamp["transform"] = {"translation": [0, 0, 1.5]}
    added = client.post(f"{session}/edits", json={"edits": [{"op": "add", "object": lamp}]})
    assert added.status_code == 200, added.text


@pytest.mark.parametrize(
    ("media", "content", "query", "location"),
    [
        (GLB, b"glTF", {}, ["body", "header"]),
        (GLB, b"", {}, ["body"]),
        (GLB, b"{}", {}, ["body", "asset"]),
        ("model/obj", b"v 0 0 0\nf 1 2 3\n", {}, ["body", "line", 2]),
        ("text/x-mgf", b"i a.mgf\n", {}, ["body", "line", 1]),
        ("application/zip", packed(("../a.obj", b"")), {}, ["body", "archive", 0]),
        ("application/octet-stream", b"", {}, ["query", "format"]),
        (GLB, b"{}", {"format": "doc"}, ["query", "format"]),
        (GLB, b"{}", {"scale": 0}, ["query", "scale"]),
        (GLB, b"{}", {"speed": 1}, ["query", "speed"]),
        (GLB, b"{}", {"settings": "{"}, ["query", "settings"]),
        (GLB, b"{}", {"settings": '{"error_tolerance": 7}'}, ["query", "settings", "error_tolerance"]),
        (GLB, b"{}", {"settings": "[]"}, ["query", "settings"]),
    ],
)
def test_faults_are_named(
    client: TestClient, media: str, content: bytes, query: dict[str, Any], location: list[str | int]
) -> None:
    (found,) = fields_at_fault(post(client, content, media, **query))
    assert found == location


def test_types_that_pages_may_send_unasked_are_not_taken(client: TestClient) -> None:
    for media in ("text/plain", "multipart/form-data", "application/x-www-form-urlencoded", "model/vrml"):
        problem_of(post(client, WALL.encode(), media), 415)
    problem_of(client.patch("/v1/sessions/x/settings", content=b"", headers={"Content-Type": GLB}), 404)


def test_limits_count_for_files_too(client: TestClient) -> None:
    # The service of these tests takes bodies of a megabyte, and archives that unpack to four.
    problem_of(post(client, bytes(2**20 + 1), "model/stl"), 413)
    problem_of(post(client, packed(("a.obj", bytes(5 * 2**20))), "application/zip"), 413)
    strip = "".join(f"v {k} {k % 2} {k * k % 7}\n" for k in range(20_003))
    many = strip + "".join(f"f {k} {k + 1} {k + 2}\n" for k in range(1, 20_002))
    problem_of(post(client, many.encode(), "model/obj", merge=False), 413)


def test_files_need_the_token_before_they_are_read() -> None:
    with app_client(token="secret", pool_size=0) as client:
        problem_of(post(client, b"nonsense", GLB), 401)
        assert post(client, b"nonsense", GLB, "/v1/convert").status_code == 401
        answer = client.post(
            "/v1/convert",
            content=b"nonsense",
            headers={"Content-Type": GLB, "Authorization": "Bearer secret"},
        )
        problem_of(answer, 422)


@pytest.mark.parametrize("chosen", SOUND)
def test_damaged_files_are_never_our_fault(client: TestClient, chosen: str) -> None:
    @given(st.data())
    @settings(max_examples=40, suppress_health_check=list(HealthCheck))
    def run(data: st.DataObject) -> None:
        sound = data.draw(st.sampled_from(SOUND[chosen]))
        cut = sound[: data.draw(st.integers(0, len(sound)))] + data.draw(st.binary(max_size=8))
        answer = post(client, cut, "application/octet-stream", "/v1/convert", format=chosen)
        assert answer.status_code in {200, 413, 422}, answer.text
        if answer.status_code != 200:
            problem_of(answer, answer.status_code)

    run()


def test_materials_come_with_an_archive(client: TestClient) -> None:
    content = packed(("a/a.obj", OBJ.replace("/1", "").replace("/2", "").encode()), ("a/room.mtl", MTL))
    found = post(client, content, "application/zip", "/v1/convert").json()["scene"]["objects"]
    assert found[0]["material"]["reflectance"] == [0.2, 0.3, 0.4]
