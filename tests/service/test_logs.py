"""Logs: each request a line, with the names of the request and of its session."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from service import logs
from service.logs import LogStyle
from tests.engine.scenes import box_document
from tests.service.apps import serving


@pytest.fixture
def logger() -> Iterator[logging.Logger]:
    """The service's logger, as it was afterwards."""
    logger = logging.getLogger("service")
    before = (logger.handlers[:], logger.level, logger.propagate)
    yield logger
    logger.handlers[:], logger.level, logger.propagate = before


def lines_of(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return [line for line in capsys.readouterr().err.splitlines() if "answered" in line]


def test_a_request_is_a_line_of_json(
    client: TestClient, settled: str, logger: logging.Logger, capsys: pytest.CaptureFixture[str]
) -> None:
    logs.configure(LogStyle.JSON)
    answer = client.get(settled, headers={"X-Request-Id": "mine-1"})
    assert answer.headers["x-request-id"] == "mine-1"
    (line,) = map(json.loads, lines_of(capsys))
    assert (line["request"], line["session"]) == ("mine-1", settled.rpartition("/")[2])
    assert (line["method"], line["status"], line["level"]) == ("GET", 200, "info")
    assert line["route"].endswith("/sessions/{id}")
    assert line["ms"] > 0.0


def test_a_name_that_would_break_a_line_is_not_taken_over(
    client: TestClient, logger: logging.Logger, capsys: pytest.CaptureFixture[str]
) -> None:
    logs.configure(LogStyle.TEXT)
    answer = client.get("/v1/sessions/nobody", headers={"X-Request-Id": "a b=c"})
    name = answer.headers["x-request-id"]
    assert len(name) == 16
    (line,) = lines_of(capsys)
    assert f"request={name} session=nobody" in line
    assert "status=404" in line


class Lines(logging.Handler):
    """What a logger is told."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.told.append(record.getMessage())


@pytest.fixture
def server_lines() -> Iterator[list[str]]:
    """What uvicorn logs."""
    lines, logger = Lines(), logging.getLogger("uvicorn.error")
    logger.addHandler(lines)
    yield lines.told
    logger.removeHandler(lines)


def test_a_refused_stream_is_one_line(
    logger: logging.Logger, server_lines: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    logs.configure(LogStyle.JSON)
    with serving(tokens="ann", max_session_streams=1) as http:
        ann = {"Authorization": "Bearer ann"}
        opened = http.post("/v1/sessions", json={"scene": box_document()}, headers=ann)
        path, url = opened.headers["location"], f"ws{str(http.base_url).removeprefix('http')}"
        with connect(f"{url}{path}/stream", additional_headers=ann):
            refused = [
                (401, path, {}),
                (404, "/v1/sessions/nobody", ann),
                (403, path, ann | {"Origin": "http://elsewhere"}),
                (429, path, ann),
            ]
            for status, where, headers in refused:
                with pytest.raises(InvalidStatus) as refusal:
                    connect(f"{url}{where}/stream", additional_headers=headers)
                assert refusal.value.response.status_code == status
        with pytest.raises(InvalidStatus):
            connect(f"{url}/nowhere")
    lines = [json.loads(line) for line in lines_of(capsys)]
    told = [line["status"] for line in lines if line["method"] == "WS" and line["status"] != 101]
    assert told == [401, 404, 403, 429, 403]
    assert server_lines == []


def test_quiet_is_quiet(client: TestClient, capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure(LogStyle.QUIET)
    assert client.get("/healthz").headers["x-request-id"]
    assert lines_of(capsys) == []
