"""Undo, redo and the change log over HTTP."""

from __future__ import annotations

import os
import signal

from fastapi.testclient import TestClient

from tests.service.conftest import context_of
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


def test_a_gesture_is_one_to_undo(client: TestClient, session: str) -> None:
    def put(height: float, gesture: str | None = None, id: str = "crate") -> None:
        edit = {"op": "move", "id": id, "transform": {"translation": [0.5, 0.5, height]}}
        body = {"edits": [edit]} | ({} if gesture is None else {"gesture": gesture})
        assert client.post(f"{session}/edits", json=body).status_code == 200

    def height(id: str = "crate") -> float:
        objects = client.get(f"{session}/scene").json()["scene"]["objects"]
        (found,) = (o for o in objects if o["id"] == id)
        return float(found.get("transform", {}).get("translation", [0, 0, 0])[2])

    def undo() -> float:
        assert client.post(f"{session}/undo").status_code == 200
        return height()

    begin = height()
    put(0.1)
    for step in range(5):
        put(0.25 + 0.125 * step, "first drag")
    for step in range(3):
        put(1.0 + 0.25 * step, "second drag")
    assert undo() == 0.75
    assert client.post(f"{session}/redo").status_code == 200
    assert height() == 1.5
    put(0.5, "second drag")
    assert undo() == 1.5, "what was redone is not joined any more"
    assert [undo(), undo(), undo()] == [0.75, 0.1, begin]
    problem_of(client.post(f"{session}/undo"), 409)


def test_a_gesture_outlasts_its_worker(client: TestClient, session: str) -> None:
    def put(height: float) -> None:
        edit = {"op": "move", "id": "crate", "transform": {"translation": [0.5, 0.5, height]}}
        assert client.post(f"{session}/edits", json={"edits": [edit], "gesture": "drag"}).status_code == 200

    put(0.1)
    before = client.get(f"{session}/scene").json()["scene"]
    put(0.2)
    # A snapshot tells it too.
    snapshot = client.get(f"{session}/snapshot").json()
    assert snapshot["gesture"] == "drag"
    assert [len(batch) for batch in snapshot["batches"]] == [1]
    worker = context_of(client).sessions.find(session.rpartition("/")[2]).worker
    os.kill(worker.pid, signal.SIGKILL)
    put(0.3)
    assert client.get(f"{session}/scene").json()["scene"] != before
    assert client.post(f"{session}/undo").json()["revision"] == 5
    problem_of(client.post(f"{session}/undo"), 409)
