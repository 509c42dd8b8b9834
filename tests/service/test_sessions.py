"""Sessions: opened, listed, looked at, configured, ended; and what they may hold."""

from __future__ import annotations

import socket
from typing import Any

import pytest
from fastapi.testclient import TestClient
from starlette.testclient import WebSocketDenialResponse

from service.hosting import remote, sessions
from service.hosting.nursery import DistantProcess, Nursery
from tests.engine.scenes import box_document
from tests.service.apps import app_client
from tests.service.conftest import LOOSE, context_of, open_box
from tests.service.problem import fields_at_fault, problem_of
from tests.service.processes import eventually, is_running


def test_a_new_session_tells_its_status_and_place(client: TestClient) -> None:
    answer = client.post("/v1/sessions", json={"scene": box_document(), "settings": LOOSE})
    assert answer.status_code == 201
    status = answer.json()
    assert answer.headers["location"] == f"/v1/sessions/{status['id']}"
    assert (status["name"], status["revision"]) == ("box", 1)
    assert status["state"] in {"solving", "converged"}
    assert 0.0 <= status["progress"] <= 1.0
    assert status["error_estimate"] >= 0.0
    assert status["unshot_fraction"] >= 0.0
    assert status["warnings"] == []
    assert status["settings"]["error_tolerance"] == 0.05
    assert status["statistics"]["polygons"] == 3
    assert status["statistics"].keys() >= {"elements", "links"}
    assert client.get(answer.headers["location"]).json()["id"] == status["id"]
    assert client.delete(answer.headers["location"]).status_code == 204


def test_a_sample_can_be_named(client: TestClient) -> None:
    names = [scene["name"] for scene in client.get("/v1/scenes").json()["scenes"]]
    assert "cornell" in names
    answer = client.post("/v1/sessions", json={"sample": "cornell"})
    assert answer.json()["statistics"]["polygons"] == 16
    assert client.delete(answer.headers["location"]).status_code == 204


@pytest.mark.parametrize("body", [{}, {"sample": "cornell", "scene": {}}])
def test_either_a_scene_or_a_sample(client: TestClient, body: dict[str, object]) -> None:
    assert fields_at_fault(client.post("/v1/sessions", json=body)) == [["body", "scene"]]


def test_an_unknown_sample_is_bad_input(client: TestClient) -> None:
    assert fields_at_fault(client.post("/v1/sessions", json={"sample": "nowhere"})) == [["body", "sample"]]


def test_sessions_are_listed(client: TestClient, settled: str) -> None:
    listed = client.get("/v1/sessions").json()["sessions"]
    (entry,) = (status for status in listed if settled.endswith(status["id"]))
    assert entry["state"] == "converged"
    assert entry == client.get(settled).json()


def test_an_ended_session_is_gone_with_its_worker(client: TestClient) -> None:
    path = open_box(client)
    pid = context_of(client).sessions.find(path.rpartition("/")[2]).worker.pid
    assert is_running(pid)
    assert client.delete(path).status_code == 204
    assert not is_running(pid)
    for answer in (client.get(path), client.delete(path), client.get(f"{path}/frame")):
        assert problem_of(answer, 404)["type"] == "urn:halflight:no-such-session"


def test_the_scene_posted_back_gives_an_equal_session(client: TestClient, session: str) -> None:
    edits = [
        {"op": "move", "id": "crate", "transform": {"rotation": [0.1, 0.2, 0.3, 0.9], "scale": [1, 2, 3]}},
        {"op": "set_material", "id": "floor", "material": {"reflectance": [0.3, 0.3, 0.3]}},
    ]
    assert client.post(f"{session}/edits", json={"edits": edits}).status_code == 200
    first = client.get(f"{session}/scene").json()
    assert first["revision"] == 2
    again = client.post("/v1/sessions", json={"scene": first["scene"], "settings": LOOSE})
    twin = again.headers["location"]
    assert client.get(f"{twin}/scene").json()["scene"] == first["scene"]
    query = {"wait": "converged", "format": "npy", "samples": 2}
    frames = [client.get(f"{path}/frame", params={**query, "layer": "position"}) for path in (session, twin)]
    assert frames[0].content == frames[1].content
    assert client.delete(twin).status_code == 204


def test_settings_change_while_a_session_runs(client: TestClient, session: str) -> None:
    answer = client.patch(f"{session}/settings", json={"error_tolerance": 0.03, "max_links": 1000})
    assert answer.status_code == 200
    settings = answer.json()["settings"]
    assert (settings["error_tolerance"], settings["max_links"]) == (0.03, 1000)
    assert client.patch(f"{session}/settings", json={}).json()["settings"] == settings
    frame = client.get(f"{session}/frame", params={"wait": "converged"})
    assert frame.headers["x-converged"] == "true"
    assert float(frame.headers["x-error-estimate"]) <= 0.03
    assert frame.headers["x-revision"] == "1"


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"error_tolerance": 0}, "error_tolerance"),
        ({"error_tolerance": "1"}, "error_tolerance"),
        ({"tolerance": 1}, "tolerance"),
    ],
)
def test_bad_settings_change_nothing(
    client: TestClient, settled: str, settings: dict[str, object], field: str
) -> None:
    before = client.get(settled).json()
    assert fields_at_fault(client.patch(f"{settled}/settings", json=settings)) == [["body", field]]
    body = {"scene": {}, "settings": settings}
    assert fields_at_fault(client.post("/v1/sessions", json=body)) == [["body", "settings", field]]
    assert client.get(settled).json() == before


def test_an_empty_scene_is_a_session(client: TestClient) -> None:
    answer = client.post("/v1/sessions", json={"scene": {}})
    assert answer.status_code == 201
    path = answer.headers["location"]
    frame = client.get(f"{path}/frame", params={"wait": "converged", "width": 8, "height": 8})
    assert frame.status_code == 200
    assert frame.headers["x-converged"] == "true"
    scene = client.get(f"{path}/scene").json()["scene"]
    assert scene["objects"] == []
    assert client.delete(path).status_code == 204


def test_limits_are_told_and_free_what_was_taken() -> None:
    limits = {
        "max_sessions": 1,
        "max_polygons": 4,
        "max_vertices": 12,
        "max_elements": 1000,
        "max_links": 1000,
    }
    with app_client(pool_size=1, max_edits=2, max_probe_points=1, **limits) as client:
        square = box_document()["objects"][0]
        many = {"objects": [{**square, "id": str(n)} for n in range(5)]}
        problem = problem_of(client.post("/v1/sessions", json={"scene": many}), 413)
        assert "polygons" in problem["detail"]
        corners = {"vertices": [[0, 0, 0]] * 13, "faces": []}
        answer = client.post("/v1/sessions", json={"scene": {"objects": [{"id": "a", "mesh": corners}]}})
        assert "vertices" in problem_of(answer, 413)["detail"]
        for name in ("max_elements", "max_links"):
            answer = client.post("/v1/sessions", json={"scene": {}, "settings": {name: 1001}})
            assert name in problem_of(answer, 413)["detail"]

        path = open_box(client)
        answer = client.post("/v1/sessions", json={"scene": {}})
        assert problem_of(answer, 429)["type"] == "urn:halflight:too-many-sessions"
        assert int(answer.headers["retry-after"]) > 0
        added = [{"op": "add", "object": {**square, "id": name}} for name in "ab"]
        assert "polygons" in problem_of(client.post(f"{path}/edits", json={"edits": added}), 413)["detail"]
        moves = [{"op": "move", "id": "crate", "transform": {}}] * 3
        assert "edits" in problem_of(client.post(f"{path}/edits", json={"edits": moves}), 413)["detail"]
        points = [{"position": [0, 0, 0], "normal": [0, 0, 1]}] * 2
        assert "points" in problem_of(client.post(f"{path}/probe", json={"points": points}), 413)["detail"]
        answer = client.patch(f"{path}/settings", json={"max_elements": 1001})
        assert "max_elements" in problem_of(answer, 413)["detail"]
        assert client.get(path).json()["revision"] == 1

        assert client.delete(path).status_code == 204
        assert client.delete(open_box(client)).status_code == 204, "there is room again"


@pytest.mark.slow
def test_an_idle_session_sleeps_until_it_is_needed() -> None:
    with app_client(pool_size=2, idle_seconds=0.4) as client:
        path = open_box(client)
        edits = {"edits": [{"op": "remove", "id": "crate"}]}
        assert client.post(f"{path}/edits", json=edits).json()["revision"] == 2
        assert client.patch(f"{path}/settings", json={"error_tolerance": 0.04}).status_code == 200
        pid = context_of(client).sessions.find(path.rpartition("/")[2]).worker.pid

        def listed() -> dict[str, Any]:
            (entry,) = client.get("/v1/sessions").json()["sessions"]
            assert isinstance(entry, dict)
            return entry

        assert eventually(lambda: not listed()["awake"])
        assert eventually(lambda: not is_running(pid))
        asleep = listed()
        assert (asleep["state"], asleep["revision"], asleep["progress"]) == ("paused", 2, 0.0)
        assert asleep["settings"]["error_tolerance"] == 0.04
        assert asleep["name"] == "box"
        assert 'halflight_sessions_by_state{state="asleep"} 1.0' in client.get("/metrics").text
        status = client.get(path).json()
        assert (status["awake"], status["revision"]) == (True, 2)
        assert status["settings"] == asleep["settings"]
        assert client.post(f"{path}/undo").json()["revision"] == 3
        assert client.delete(path).status_code == 204
        assert client.get("/v1/sessions").json() == {"sessions": []}


def test_a_session_that_nobody_wants_expires() -> None:
    with app_client(pool_size=1, expire_seconds=0.4) as client:
        path = open_box(client)
        pid = context_of(client).sessions.find(path.rpartition("/")[2]).worker.pid
        assert eventually(lambda: client.get("/v1/sessions").json() == {"sessions": []})
        problem_of(client.get(path), 404)
        assert eventually(lambda: not is_running(pid))


@pytest.mark.slow
def test_who_dozes_makes_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sessions, "_DOZING", 0.0)
    with app_client(pool_size=2, max_sessions=1, max_kept_sessions=2) as client:
        first, second = open_box(client), open_box(client)
        awake = {f"/v1/sessions/{s['id']}": s["awake"] for s in client.get("/v1/sessions").json()["sessions"]}
        assert awake == {first: False, second: True}
        answer = client.post("/v1/sessions", json={"scene": {}})
        assert "kept" in problem_of(answer, 429)["detail"]
        assert int(answer.headers["retry-after"]) > 0
        assert client.get(first).json()["awake"]
        for path in (first, second):
            assert client.delete(path).status_code == 204


@pytest.mark.slow
def test_a_used_session_does_not_expire() -> None:
    with app_client(pool_size=1, idle_seconds=0.4) as client:
        path = open_box(client, error_tolerance=1e-6, max_elements=20)
        # The solve stops at its limit, so that the wait ends by its own time, later than the idle time.
        query = {"renderer": "path", "wait": "max_error=1e-9", "timeout_ms": 1500}
        assert client.get(f"{path}/frame", params=query).status_code == 200
        assert client.get(path).status_code == 200


def test_a_token_is_asked_for_where_there_is_one() -> None:
    with app_client(token="secret", pool_size=0) as client:
        for path in ("/v1/sessions", "/v1/scenes", "/metrics"):
            answer = client.get(path)
            assert problem_of(answer, 401)["type"] == "urn:halflight:unauthorized"
            assert answer.headers["www-authenticate"] == "Bearer"
            assert client.get(path, headers={"Authorization": "Bearer secre"}).status_code == 401
            assert client.get(path, headers={"Authorization": "Basic secret"}).status_code == 401
            assert client.get(path, headers={"Authorization": "Bearer secret"}).status_code == 200
        assert client.get("/healthz").status_code == 200
        assert client.get("/").status_code == 200


def test_a_token_opens_its_own_sessions_alone() -> None:
    ann, ben, every = ({"Authorization": f"Bearer {token}"} for token in ("ann", "ben", "all"))
    with app_client(token="all", tokens="ann, ben", pool_size=0) as client:
        problem_of(client.get("/v1/sessions"), 401)
        answer = client.post("/v1/sessions", json={"scene": box_document(), "settings": LOOSE}, headers=ann)
        path = answer.headers["location"]
        for told in (
            client.get(path, headers=ben),
            client.get(f"{path}/scene", headers=ben),
            client.get(f"{path}/frame", headers=ben),
            client.post(f"{path}/undo", headers=ben),
            client.delete(path, headers=ben),
        ):
            assert problem_of(told, 404)["type"] == "urn:halflight:no-such-session"
        with (
            pytest.raises(WebSocketDenialResponse) as denied,
            client.websocket_connect(f"{path}/stream", headers=ben),
        ):
            pass
        assert denied.value.status_code == 404
        assert client.get("/v1/sessions", headers=ben).json() == {"sessions": []}
        for own in (ann, every):
            assert client.get(path, headers=own).status_code == 200
            assert len(client.get("/v1/sessions", headers=own).json()["sessions"]) == 1
        assert client.delete(path, headers=every).status_code == 204


def test_a_worker_that_does_not_start_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody(self: Nursery, theirs: socket.socket, board: int) -> DistantProcess:
        raise ConnectionError

    monkeypatch.setattr(Nursery, "worker", nobody)
    with app_client(pool_size=0) as client:
        answer = client.post("/v1/sessions", json={"scene": {}})
        assert "could not be started" in problem_of(answer, 503)["detail"]
        assert client.get("/v1/sessions").json() == {"sessions": []}
    with pytest.raises(remote.WorkerNotStartedError), app_client(pool_size=1):
        pass
