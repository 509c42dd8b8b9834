"""Edits over HTTP: atomic, answered at once, seen at once; and every kind of bad batch."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from tests.service.problem import fields_at_fault, problem_of

MOVE = {"op": "move", "id": "crate", "transform": {"translation": [-0.5, -0.5, 0.5]}}
MESH = {"vertices": [[0, 0, 1], [1, 0, 1], [0, 1, 1]], "faces": [[0, 1, 2]]}


def test_a_batch_is_answered_with_its_entries_and_seen_at_once(client: TestClient, session: str) -> None:
    batch = {
        "if_revision": 1,
        "edits": [MOVE, {"op": "add", "object": {"id": "sail", "mesh": MESH}}],
    }
    answer = client.post(f"{session}/edits", json=batch)
    assert answer.status_code == 200
    assert answer.json()["revision"] == 2
    entries = answer.json()["changes"]
    assert [(e["entry"], e["revision"], e["op"], e["id"]) for e in entries] == [
        (1, 2, "move", "crate"),
        (2, 2, "add", "sail"),
    ]
    assert all(e["state"] == "pending" and e["shots"] == 0 for e in entries)
    frame = client.get(f"{session}/frame", params={"layer": "object", "format": "npy"})
    assert frame.headers["x-revision"] == "2"
    objects = np.load(io.BytesIO(frame.content))[:, :, 0]
    assert (objects[24:, :24] == 2).any(), "the crate is in the lower left"
    assert (objects == 3).any(), "the sail is there"
    status = client.get(session).json()
    assert status["revision"] == 2
    scene = client.get(f"{session}/scene").json()
    assert scene["revision"] == 2
    assert [o["id"] for o in scene["scene"]["objects"]] == ["floor", "lamp", "crate", "sail"]


def test_an_edit_interrupts_the_solve_and_the_new_one_converges(client: TestClient, session: str) -> None:
    assert client.patch(f"{session}/settings", json={"error_tolerance": 1e-5}).status_code == 200
    for revision in range(2, 8):
        answer = client.post(f"{session}/edits", json={"edits": [MOVE], "if_revision": revision - 1})
        assert answer.json()["revision"] == revision
        assert client.get(session).json()["state"] == "solving"
    assert client.patch(f"{session}/settings", json={"error_tolerance": 0.05}).status_code == 200
    frame = client.get(f"{session}/frame", params={"wait": "converged"})
    assert (frame.headers["x-revision"], frame.headers["x-converged"]) == ("7", "true")


def test_edits_of_another_revision_conflict(client: TestClient, settled: str) -> None:
    for revision in (0, 2, 2**62):
        answer = client.post(f"{settled}/edits", json={"edits": [MOVE], "if_revision": revision})
        problem = problem_of(answer, 409)
        assert problem["type"] == "urn:halflight:revision-conflict"
        assert "revision 1" in problem["detail"]
    assert client.get(settled).json()["revision"] == 1


def of(edit: dict[str, Any]) -> dict[str, Any]:
    return {"edits": [MOVE, edit]}


BAD: list[tuple[object, list[str | int]]] = [
    ({}, ["body", "edits"]),
    ([], ["body"]),
    ({"edits": []}, ["body", "edits"]),
    ({"edits": MOVE}, ["body", "edits"]),
    ({"edits": [MOVE], "if_revision": "1"}, ["body", "if_revision"]),
    ({"edits": [MOVE], "if_revision": 1.5}, ["body", "if_revision"]),
    ({"edits": [MOVE], "if_revision": -1}, ["body", "if_revision"]),
    ({"edits": [MOVE], "if_revision": 10**30}, ["body", "if_revision"]),
    ({"edits": [MOVE], "revision": 1}, ["body", "revision"]),
    (of({"id": "crate"}), ["body", "edits", 1, "op"]),
    (of({"op": "paint", "id": "crate"}), ["body", "edits", 1, "op"]),
    (of({"op": "remove"}), ["body", "edits", 1, "id"]),
    (of({"op": "remove", "id": "nobody"}), ["body", "edits", 1, "id"]),
    (of({"op": "remove", "id": "crate", "why": 1}), ["body", "edits", 1, "why"]),
    (of({"op": "move", "id": "crate"}), ["body", "edits", 1, "transform"]),
    (
        of({"op": "move", "id": "crate", "transform": {"rotation": [0, 0, 0, 0]}}),
        ["body", "edits", 1, "transform", "rotation"],
    ),
    (
        of({"op": "move", "id": "crate", "transform": {"scale": [1, "2", 3]}}),
        ["body", "edits", 1, "transform", "scale", 1],
    ),
    (
        of({"op": "set_material", "id": "crate", "material": {"reflectance": [0, 0, 1]}}),
        ["body", "edits", 1, "material", "reflectance", 2],
    ),
    (
        of({"op": "set_material", "id": "crate", "material": {"specular": [0.3, 0.5, 0.3]}}),
        ["body", "edits", 1, "material", "specular", 1],
    ),
    (
        of({"op": "set_material", "id": "crate", "material": {"exponent": "mirror"}}),
        ["body", "edits", 1, "material", "exponent"],
    ),
    (
        of({"op": "set_mesh", "id": "crate", "mesh": {"vertices": [], "faces": [[0, 1, 2]]}}),
        ["body", "edits", 1, "mesh", "faces", 0, 0],
    ),
    (of({"op": "add", "object": {"id": "crate", "mesh": MESH}}), ["body", "edits", 1, "object", "id"]),
    (of({"op": "add", "object": {"id": "new"}}), ["body", "edits", 1, "object", "mesh"]),
    (of({"op": "add", "id": "new", "mesh": MESH}), ["body", "edits", 1, "object"]),
]


@pytest.mark.parametrize(("batch", "location"), BAD)
def test_a_bad_batch_names_the_field_and_changes_nothing(
    client: TestClient, settled: str, batch: object, location: list[str | int]
) -> None:
    before = client.get(settled).json()
    scene = client.get(f"{settled}/scene").json()
    frame = client.get(f"{settled}/frame")
    assert fields_at_fault(client.post(f"{settled}/edits", json=batch))[0] == location
    assert client.get(settled).json() == before
    assert client.get(f"{settled}/scene").json() == scene
    again = client.get(f"{settled}/frame")
    assert (again.headers["etag"], again.content) == (frame.headers["etag"], frame.content)
