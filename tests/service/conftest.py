"""One service for all tests of this directory, in this process; and sessions on the box."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.context import Context
from tests.engine.scenes import box_document
from tests.service.apps import NURSERY, app_client

LOOSE = {"error_tolerance": 0.05}


@pytest.fixture(scope="session", autouse=True)
def nursery() -> Iterator[None]:
    yield
    NURSERY.close()


@pytest.fixture(scope="session")
def client() -> Iterator[TestClient]:
    with app_client(max_sessions=8, max_body_bytes=2**20) as client:
        yield client


def context_of(client: TestClient) -> Context:
    context = client.app.state.context  # type: ignore[attr-defined]
    assert isinstance(context, Context)
    return context


def open_box(client: TestClient, **settings: Any) -> str:
    """The path of a new session on the box."""
    answer = client.post("/v1/sessions", json={"scene": box_document(), "settings": LOOSE | settings})
    assert answer.status_code == 201, answer.text
    return str(answer.headers["location"])


@pytest.fixture(scope="session")
def settled(client: TestClient) -> Iterator[str]:
    """The path of a session that has converged, and that no test may change."""
    path = open_box(client)
    frame = client.get(f"{path}/frame", params={"wait": "converged"})
    assert frame.headers["x-converged"] == "true"
    yield path
    assert client.get(path).json()["revision"] == 1
    assert client.delete(path).status_code == 204


@pytest.fixture
def session(client: TestClient) -> Iterator[str]:
    """The path of a session that the test may change."""
    path = open_box(client)
    yield path
    assert client.delete(path).status_code in {204, 404}
