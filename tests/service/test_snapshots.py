"""Snapshots: what a session was, as a file, and sessions made of it."""

from __future__ import annotations

from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.service.problem import fields_at_fault, problem_of


def paint(grey: float) -> dict[str, Any]:
    return {"op": "set_material", "id": "floor", "material": {"reflectance": [grey] * 3}}


def move(x: float) -> dict[str, Any]:
    return {"op": "move", "id": "crate", "transform": {"translation": [x, 0.5, 0.5]}}


def edit(client: TestClient, path: str, *edits: dict[str, Any]) -> int:
    return int(client.post(f"{path}/edits", json={"edits": list(edits)}).json()["revision"])


def standing(client: TestClient, path: str) -> tuple[Any, Any]:
    scene = client.get(f"{path}/scene").json()
    entries = client.get(f"{path}/log").json()["entries"]
    return scene["scene"], [(entry["entry"], entry["op"], entry["id"]) for entry in entries]


def lead_a_life(client: TestClient, path: str) -> Any:
    """The session's snapshot after some edits."""
    edit(client, path, paint(0.2))
    edit(client, path, move(0.1))
    edit(client, path, move(0.2))
    client.post(f"{path}/undo")
    client.patch(f"{path}/settings", json={"error_tolerance": 0.04})
    answer = client.get(f"{path}/snapshot")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/json"
    assert "attachment" in answer.headers["content-disposition"]
    return answer.json()


def test_a_session_of_a_snapshot_stands_as_the_first_did(client: TestClient, session: str) -> None:
    snapshot = lead_a_life(client, session)
    answer = client.post("/v1/sessions", json={"snapshot": snapshot})
    assert answer.status_code == 201, answer.text
    twin = answer.headers["location"]
    assert (answer.json()["revision"], answer.json()["settings"]["error_tolerance"]) == (5, 0.04)
    assert standing(client, twin) == standing(client, session)
    assert client.get(f"{twin}/snapshot").json() == snapshot
    for call in ("redo", "undo", "undo", "undo"):
        for path in (twin, session):
            assert client.post(f"{path}/{call}").status_code == 200
        assert standing(client, twin) == standing(client, session)
    assert client.delete(twin).status_code == 204


def test_settings_may_be_given_with_a_snapshot(client: TestClient, session: str) -> None:
    snapshot = client.get(f"{session}/snapshot").json()
    body = {"snapshot": snapshot, "settings": {"error_tolerance": 0.2}}
    answer = client.post("/v1/sessions", json=body)
    assert answer.json()["settings"]["error_tolerance"] == 0.2
    assert client.delete(answer.headers["location"]).status_code == 204


def test_a_session_is_brought_back_to_a_snapshot(client: TestClient, session: str) -> None:
    snapshot = lead_a_life(client, session)
    before = standing(client, session)
    edit(client, session, {"op": "remove", "id": "crate"})
    assert edit(client, session, paint(0.7)) == 7
    answer = client.post(f"{session}/snapshot", json=snapshot)
    assert answer.status_code == 200, answer.text
    assert answer.json()["revision"] == 8, "no revision stands for two scenes"
    assert standing(client, session) == before
    assert client.post(f"{session}/redo").json()["revision"] == 9
    assert client.post(f"{session}/undo").json()["revision"] == 10
    assert standing(client, session)[0] == before[0]


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"batches": [[{"op": "remove", "id": "nobody"}]]}, ["batches", 0, 0, "id"]),
        ({"batches": [[paint(0.2)]], "undone": [[move(0), paint(0.1), paint(2)]]}, None),
        ({"undone": [[paint(0.1), {"op": "remove", "id": "x"}]]}, ["undone", 0, 1, "id"]),
        ({"kind": "something else"}, ["kind"]),
        ({"revision": 0}, ["revision"]),
        ({"more": 1}, ["more"]),
    ],
)
def test_what_is_wrong_with_a_snapshot_is_named(
    client: TestClient, settled: str, changes: dict[str, Any], field: list[str | int] | None
) -> None:
    snapshot = client.get(f"{settled}/snapshot").json() | changes
    made = fields_at_fault(client.post("/v1/sessions", json={"snapshot": snapshot}))
    restored = fields_at_fault(client.post(f"{settled}/snapshot", json=snapshot))
    assert made == [["body", "snapshot", *place[1:]] for place in restored]
    assert field is None or restored == [["body", *field]]


def test_one_of_three_ways_to_begin(client: TestClient, settled: str) -> None:
    snapshot = client.get(f"{settled}/snapshot").json()
    body = {"snapshot": snapshot, "sample": "cornell"}
    assert fields_at_fault(client.post("/v1/sessions", json=body)) == [["body", "scene"]]


def test_a_request_with_a_key_is_made_once(client: TestClient, session: str) -> None:
    def post(call: str, key: str, body: dict[str, Any] | None = None) -> Any:
        return client.post(f"{session}/{call}", json=body, headers={"Idempotency-Key": key})

    batch = {"edits": [paint(0.2), move(0.3)], "if_revision": 1}
    first = post("edits", "a", batch)
    assert (first.status_code, first.json()["revision"]) == (200, 2)
    assert post("edits", "a", batch).json() == first.json(), "if_revision is not looked at again"
    assert client.get(session).json()["revision"] == 2
    other = post("edits", "a", {"edits": [paint(0.3)]})
    assert fields_at_fault(other) == [["header", "Idempotency-Key"]]
    assert other.json()["type"] == "urn:halflight:key-used"
    assert problem_of(post("undo", "a"), 422)
    assert post("undo", "b").json()["revision"] == 3
    assert post("undo", "b").json()["revision"] == 3
    assert post("redo", "c").json()["revision"] == 4
    problem_of(post("redo", "d"), 409)
    assert post("undo", "d").json()["revision"] == 5, "what was refused has used no key"
    worker = client.app.state.context.sessions.find(session.rpartition("/")[2]).worker  # type: ignore[attr-defined]
    client.portal.call(worker.sleep)  # type: ignore[union-attr]
    assert post("edits", "a", batch).json() == first.json()
    assert client.get(session).json()["revision"] == 5
