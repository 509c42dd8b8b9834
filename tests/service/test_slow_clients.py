"""Clients that never finish what they send are given up, and streams are counted."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack

import httpx
import pytest
import websockets
from websockets.sync.client import connect

from tests.engine.scenes import box_document
from tests.service.apps import serving
from tests.service.problem import problem_of
from tests.service.processes import PATIENCE

LIMITS = {"head_seconds": 0.3, "body_seconds": 0.3, "body_rate": 1e5}


@pytest.fixture(scope="module")
def http() -> Iterator[httpx.Client]:
    with serving(max_session_streams=2, max_streams=3, **LIMITS) as http:
        yield http


def connection(http: httpx.Client) -> socket.socket:
    return socket.create_connection((http.base_url.host, http.base_url.port or 80), PATIENCE)


def all_of(line: socket.socket) -> bytes:
    """What comes until the service hangs up."""
    parts = []
    while part := line.recv(65536):
        parts.append(part)
    return b"".join(parts)


@pytest.mark.parametrize("sent", [b"", b"GET /healthz HTTP/1.1\r\nHost: here\r\n"])
def test_a_head_that_does_not_come_is_given_up(http: httpx.Client, sent: bytes) -> None:
    with connection(http) as line:
        line.sendall(sent)
        assert all_of(line).startswith(b"HTTP/1.1 408 ")


def test_dripping_a_head_does_not_help(http: httpx.Client) -> None:
    with connection(http) as line:
        line.sendall(b"GET /healthz HTTP/1.1\r\n")
        start = time.monotonic()
        with pytest.raises(OSError):
            while time.monotonic() - start < PATIENCE:
                line.sendall(b"X-More: 1\r\n")
                time.sleep(0.05)
        assert time.monotonic() - start < 5.0


def test_a_connection_that_is_kept_may_rest_between_requests(http: httpx.Client) -> None:
    with connection(http) as line:
        for _ in range(2):
            line.sendall(b"GET /nowhere HTTP/1.1\r\nHost: here\r\n\r\n")
            answer = b""
            while b"there is nothing at" not in answer:
                part = line.recv(65536)
                assert part, "the service has hung up"
                answer += part
            time.sleep(0.4)


def test_a_body_that_comes_too_slowly_is_refused(http: httpx.Client) -> None:
    with connection(http) as line:
        line.sendall(
            b"POST /v1/sessions HTTP/1.1\r\nHost: here\r\nContent-Type: application/json\r\n"
            b"Content-Length: 1000\r\n\r\n{"
        )
        head, _, body = all_of(line).partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 408 ")
        assert json.loads(body)["type"] == "urn:halflight:too-slow"
    assert http.get("/v1/sessions").json() == {"sessions": []}


def test_a_large_body_has_its_time(http: httpx.Client) -> None:
    """It takes longer than a small one may, but comes fast enough."""
    text = json.dumps({"scene": {"name": "x" * 60_000}, "settings": {"error_tolerance": -1}}).encode()

    def slowly() -> Iterator[bytes]:
        for start in range(0, len(text), 15_000):
            yield text[start : start + 15_000]
            time.sleep(0.1)

    answer = http.post("/v1/sessions", content=slowly(), headers={"Content-Type": "application/json"})
    assert answer.status_code == 422


def test_streams_are_counted(http: httpx.Client) -> None:
    body = {"scene": box_document(), "settings": {"error_tolerance": 0.5}}
    paths = [http.post("/v1/sessions", json=body).headers["location"] for _ in range(2)]
    places = [f"ws://{http.base_url.host}:{http.base_url.port}{path}/stream" for path in paths]

    def refused(place: str) -> str:
        with pytest.raises(websockets.InvalidStatus) as denied, connect(place):
            pass
        response = denied.value.response
        assert response.status_code == 429
        assert int(response.headers["retry-after"]) > 0
        problem = json.loads(response.body or b"")
        assert problem["type"] == "urn:halflight:too-many-streams"
        return str(problem["detail"])

    with ExitStack() as open_streams:
        open_streams.enter_context(connect(places[0]))
        open_streams.enter_context(http.stream("GET", f"{paths[0]}/events"))
        assert "the session has 2 streams" in refused(places[0])
        problem_of(http.get(f"{paths[0]}/events"), 429)
        open_streams.enter_context(connect(places[1]))
        assert "the service has 3 streams" in refused(places[1])
    with connect(places[0]) as stream:
        assert json.loads(stream.recv())["type"] == "status"
    for path in paths:
        assert http.delete(path).status_code == 204
