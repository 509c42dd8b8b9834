"""Logs: each request a line, with the names of the request and of its session."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from service import logs
from service.logs import LogStyle


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


def test_quiet_is_quiet(client: TestClient, capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure(LogStyle.QUIET)
    assert client.get("/healthz").headers["x-request-id"]
    assert lines_of(capsys) == []
