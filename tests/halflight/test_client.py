"""The Python client: the tour of its documentation, and what it does where answers are lost."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

from halflight.client import Client, ProblemError, move, set_material
from tests.engine.scenes import box_document
from tests.service.test_server import running

TOUR = Path(__file__).resolve().parent.parent.parent / "docs" / "client.md"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with running(HALFLIGHT_TOKENS="ann,ben", HALFLIGHT_WAKE_SECONDS="60") as service:
        yield str(service.http.base_url)


@pytest.mark.slow
def test_the_tour_of_the_documentation_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    snippets = re.findall(r"```python\n(.*?)```", TOUR.read_text(), re.DOTALL)
    assert len(snippets) > 5
    said = io.StringIO()
    with running() as service, contextlib.redirect_stdout(said):
        monkeypatch.chdir(tmp_path)
        tour = "\n".join(snippets).replace("http://127.0.0.1:8000", str(service.http.base_url))
        exec(compile(tour, str(TOUR), "exec"), {"__name__": "tour"})
        assert service.http.get("/v1/sessions").json() == {"sessions": []}
    lines = said.getvalue().splitlines()
    assert lines[0] in {"solving", "converged"}
    assert lines[1].startswith("converged")
    assert lines[2].startswith("(160, 160, 3)")
    assert "tall_block" in lines[3]
    assert "lux" in lines[4]
    assert lines[-1] == "422 ['body', 'edits', 0, 'id']"
    assert (tmp_path / "cornell.png").exists()


def test_a_token_is_shown(address: str) -> None:
    with Client(address, token="ann") as ann, Client(address, token="ben") as ben, Client(address) as none:
        with ann.open(box_document(), settings={"error_tolerance": 0.1}) as session:
            assert [status.id for status in ann.sessions()] == [session.id]
            assert ben.sessions() == []
            with pytest.raises(ProblemError) as refused:
                ben.session(session.id).status()
            assert (refused.value.status, refused.value.kind) == (404, "urn:halflight:no-such-session")
            with pytest.raises(ProblemError, match="401"):
                none.sessions()
        assert ann.sessions() == []


class Lossy(httpx.BaseTransport):
    """A connection that loses every other answer, after the service has made it."""

    def __init__(self) -> None:
        self._through = httpx.HTTPTransport()
        self._count = 0

    def close(self) -> None:
        self._through.close()

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        answer = self._through.handle_request(request)
        self._count += 1
        if self._count % 2:
            answer.read()
            answer.close()
            raise httpx.ReadError("lost", request=request)
        return answer


def test_a_change_is_made_once_though_answers_are_lost(address: str) -> None:
    with Client(address, token="ann") as client, client.open(box_document()) as session:
        with Client(address, token="ann") as unlucky:
            unlucky._http._transport.close()
            unlucky._http._transport = Lossy()
            lossy = unlucky.session(session.id)
            assert lossy.edit(move("crate", translation=[0.1, 0, 0])).revision == 2
            assert lossy.edit(set_material("floor", reflectance=[0.2] * 3), if_revision=2).revision == 3
            assert lossy.undo().revision == 4
        assert session.status().revision == 4
        assert [entry.op for entry in session.log()] == ["move", "set_material", "set_material"]
        unhurried = session.configure(error_tolerance=0.2)
        assert unhurried.settings["error_tolerance"] == 0.2
        session.wait()
        assert np.isfinite(session.probe([0, 0, 1], [0, 0, 1]).illuminance).all()


def test_a_conflict_is_told_at_once(address: str) -> None:
    with (
        Client(address, token="ann") as client,
        client.open(box_document()) as session,
        pytest.raises(ProblemError) as refused,
    ):
        session.edit(move("crate", translation=[0, 0, 0]), if_revision=7)
    assert refused.value.status == 409


def test_nobody_answers() -> None:
    with Client("http://127.0.0.1:1", patience=0.1) as client, pytest.raises(httpx.ConnectError):
        client.sessions()
