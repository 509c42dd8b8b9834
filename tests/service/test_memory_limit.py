"""A session that takes too much memory is paused, and says so; it goes on with the next change."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from tests.service.apps import app_client
from tests.service.conftest import open_box
from tests.service.processes import eventually

ENDLESS = {"error_tolerance": 1e-4, "max_elements": 2_000_000, "max_links": 30_000_000}
REMOVE = {"edits": [{"op": "remove", "id": "lamp"}]}


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    with app_client(pool_size=1, max_session_bytes=64 * 2**20) as client:
        yield client


def test_it_is_paused_with_a_warning_and_answers_on(client: TestClient) -> None:
    opened = client.post("/v1/sessions", json={"sample": "office", "settings": ENDLESS})
    path = opened.headers["location"]
    waiting = {"wait": "converged", "width": 32, "height": 24, "renderer": "flat"}
    frame = client.get(f"{path}/frame", params=waiting)
    assert (frame.status_code, frame.headers["x-converged"]) == (200, "false")
    status = client.get(path).json()
    assert status["state"] == "paused"
    assert any("max_session_bytes" in warning for warning in status["warnings"])
    assert client.post(f"{path}/edits", json=REMOVE).json()["revision"] == 2
    assert client.get(f"{path}/frame", params={"width": 32, "height": 24}).headers["x-revision"] == "2"
    # What is left takes less.
    assert client.patch(f"{path}/settings", json={"error_tolerance": 0.5}).status_code == 200
    assert eventually(lambda: client.get(path).json()["state"] == "converged")
    assert not any("max_session_bytes" in warning for warning in client.get(path).json()["warnings"])
    assert client.delete(path).status_code == 204


def test_one_that_takes_little_is_left_alone(client: TestClient) -> None:
    path = open_box(client, error_tolerance=0.2)
    frame = client.get(f"{path}/frame", params={"wait": "converged", "renderer": "flat"})
    assert frame.headers["x-converged"] == "true"
    assert client.delete(path).status_code == 204
