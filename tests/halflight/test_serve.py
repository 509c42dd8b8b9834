"""`halflight serve`: the settings it takes, the address it prints, the port that is taken."""

from __future__ import annotations

import re
import signal
import socket
from collections.abc import Iterator

import httpx
import pytest

from halflight import serve
from service.config import ServiceSettings
from tests.halflight.commands import invoke, run, start


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield listening.getsockname()[1]


@pytest.fixture
def settings(monkeypatch: pytest.MonkeyPatch) -> list[ServiceSettings]:
    """What `serve` would have run with, in place of running."""
    caught: list[ServiceSettings] = []
    monkeypatch.setattr(serve, "run", caught.append)
    for name in ("HOST", "PORT", *(f"HALFLIGHT_{field.upper()}" for field in ServiceSettings.model_fields)):
        monkeypatch.delenv(name, raising=False)
    return caught


def test_serves_until_it_is_terminated() -> None:
    process = start("serve", "--port", "0", "--pool-size", "0")
    try:
        assert process.stdout is not None
        found = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
        assert found is not None
        answer = httpx.get(f"{found[0]}/healthz", timeout=30.0)
        assert answer.status_code == 200
    finally:
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=60.0)
    assert errors == ""


def test_a_taken_port_is_told_on_one_line(taken_port: int) -> None:
    status, output, errors = run("serve", HOST="127.0.0.1", PORT=str(taken_port))
    assert (status, output) == (1, "")
    assert errors == f"halflight: cannot listen on 127.0.0.1 port {taken_port}: address already in use\n"


def test_defaults(settings: list[ServiceSettings]) -> None:
    assert invoke("serve").exit_code == 0
    assert (settings[0].host, settings[0].port, settings[0].token) == ("127.0.0.1", 8000, None)


@pytest.mark.parametrize("prefix", ["", "HALFLIGHT_"])
def test_host_and_port_of_the_environment(
    settings: list[ServiceSettings], prefix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(f"{prefix}HOST", "0.0.0.0")
    monkeypatch.setenv(f"{prefix}PORT", "9000")
    invoke("serve")
    assert (settings[0].host, settings[0].port) == ("0.0.0.0", 9000)


def test_options_come_before_the_environment(
    settings: list[ServiceSettings], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PORT", "9000")
    monkeypatch.setenv("HALFLIGHT_MAX_EDITS", "7")
    monkeypatch.setenv("HALFLIGHT_TOKEN", "secret")
    invoke("serve", "--port", "9001", "--idle-seconds", "1.5", "--max-sessions", "3")
    (chosen,) = settings
    assert (chosen.port, chosen.idle_seconds, chosen.max_sessions, chosen.max_edits) == (9001, 1.5, 3, 7)
    assert chosen.token is not None and chosen.token.get_secret_value() == "secret"


@pytest.mark.parametrize(
    ("arguments", "environment", "named"),
    [
        (["--port", "70000"], {}, "--port: "),
        (["--pool-size", "-1"], {}, "--pool-size: "),
        ([], {"PORT": "70000"}, "HALFLIGHT_PORT: "),
        ([], {"HALFLIGHT_MAX_EDITS": "none"}, "HALFLIGHT_MAX_EDITS: "),
    ],
)
def test_bad_settings_are_named(
    settings: list[ServiceSettings],
    arguments: list[str],
    environment: dict[str, str],
    named: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    result = invoke("serve", *arguments)
    assert result.exit_code == 2
    assert not settings
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"halflight: {named}")


def test_a_port_that_is_no_number_is_refused(settings: list[ServiceSettings]) -> None:
    result = invoke("serve", "--port", "http")
    assert result.exit_code == 2
    assert "'--port'" in result.stderr and not settings
