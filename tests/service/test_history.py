"""Undo, redo and the change log over HTTP."""

from __future__ import annotations

from fastapi.testclient import TestClient

from tests.service.problem import problem_of


def test_undo_and_redo_make_new_revisions(client: TestClient, session: str) -> None:
    before = client.get(f"{session}/scene").json()["scene"]
    edits = {"edits": [{"op": "remove", "id": "crate"}]}
    assert client.post(f"{session}/edits", json=edits).json()["revision"] == 2
    without = client.get(f"{session}/scene").json()["scene"]
    answer = client.post(f"{session}/undo")
    assert answer.status_code == 200
    assert answer.json()["revision"] == 3
    assert [(change["op"], change["id"]) for change in answer.json()["changes"]] == [("add", "crate")]
    back = client.get(f"{session}/scene").json()["scene"]
    assert {o["id"]: o for o in back["objects"]} == {o["id"]: o for o in before["objects"]}
    assert client.post(f"{session}/redo").json()["revision"] == 4
    assert client.get(f"{session}/scene").json()["scene"] == without
    assert problem_of(client.post(f"{session}/redo"), 409)["type"] == "urn:halflight:nothing-to-reverse"
    assert client.get(session).json()["revision"] == 4


def test_there_is_nothing_to_undo_at_first(client: TestClient, session: str) -> None:
    for call in ("undo", "redo"):
        assert problem_of(client.post(f"{session}/{call}"), 409)["detail"] == f"there is nothing to {call}"
    assert client.get(f"{session}/log").json() == {"revision": 1, "entries": []}


def test_the_log_settles_when_the_frame_has_converged(client: TestClient, session: str) -> None:
    for x in (0.1, 0.2, 0.3):
        move = {"op": "move", "id": "crate", "transform": {"translation": [x, 0.5, 0.5]}}
        client.post(f"{session}/edits", json={"edits": [move]})
    log = client.get(f"{session}/log").json()
    assert log["revision"] == 4
    assert [(entry["op"], entry["id"]) for entry in log["entries"]] == [("remove", "crate"), ("add", "crate")]
    client.get(f"{session}/frame", params={"wait": "converged", "renderer": "flat"})
    for entry in client.get(f"{session}/log").json()["entries"]:
        assert entry["state"] == "settled"
        assert entry["energy_to_redistribute"] == 0.0
