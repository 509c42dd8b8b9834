"""The Python client: the tour of its documentation, and what it does where answers are lost."""

from __future__ import annotations

import asyncio
import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

from halflight.client import AsyncClient, AsyncSession, Client, ProblemError, move, remove, set_material
from tests.engine.scenes import box_document
from tests.service.apps import serving

TOUR = Path(__file__).resolve().parent.parent.parent / "docs" / "client.md"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with serving(tokens="ann,ben", wake_seconds=60.0) as http:
        yield str(http.base_url)


@pytest.mark.slow
def test_the_tour_of_the_documentation_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    snippets = re.findall(r"```python\n(.*?)```", TOUR.read_text(), re.DOTALL)
    assert len(snippets) > 5
    said = io.StringIO()
    with serving(pool_size=1) as http, contextlib.redirect_stdout(said):
        monkeypatch.chdir(tmp_path)
        tour = "\n".join(snippets).replace("http://127.0.0.1:8000", str(http.base_url))
        exec(compile(tour, str(TOUR), "exec"), {"__name__": "tour"})
        assert http.get("/v1/sessions").json() == {"sessions": []}
    lines = [line for line in said.getvalue().splitlines() if not line.startswith("halflight is ready")]
    assert lines[0] in {"solving", "converged"}
    assert lines[1].startswith("converged")
    assert lines[2].startswith("(160, 160, 3)")
    assert "tall_block" in lines[3]
    assert "lux" in lines[5]
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


def test_a_session_is_opened_once_though_the_answer_is_lost(address: str) -> None:
    with Client(address, token="ann") as client, Client(address, token="ann") as unlucky:
        unlucky._http._transport.close()
        unlucky._http._transport = Lossy()
        session = unlucky.open(box_document(), settings={"error_tolerance": 0.5})
        assert [status.id for status in client.sessions()] == [session.id]
        with client.open(box_document(), settings={"error_tolerance": 0.5}) as another:
            assert another.id != session.id
        client.session(session.id).close()


def test_a_stream_shows_what_is_edited_until_the_session_ends(address: str) -> None:
    with Client(address, token="ann") as client:
        session = client.open(box_document())
        with session.stream() as stream:
            stream.look(width=32, height=24, format="png", renderer="flat")
            frame = next(stream)
            assert frame.image.size == (frame.width, frame.height)
            assert frame.revision == 1
            assert stream.edit(move("crate", translation=[0.1, 0, 0]), if_revision=1).revision == 2
            with pytest.raises(ProblemError) as refused:
                stream.edit(remove("nobody"))
            assert refused.value.errors[0]["loc"] == ["message", "edits", 0, "id"]
            assert stream.undo().revision == 3
            assert stream.redo().revision == 4
            for frame in stream:
                if frame.revision == 4 and frame.converged and frame.quality == "rest":
                    break
            assert frame.array.shape == (24, 32, 3)
            assert stream.status is not None and stream.status.revision == 4
            stream.look("no such camera")
            with pytest.raises(ProblemError, match="no such camera"):
                next(stream)
            stream.look(width=16, height=12)
            assert next(stream).width <= 16
            session.close()
            assert all(frame.revision == 4 for frame in stream), "and there it ends"
        with pytest.raises(ProblemError) as gone, session.stream():
            pass
        assert gone.value.status == 404


def test_a_stream_of_asyncio(address: str) -> None:
    async def watch(session: AsyncSession) -> list[int]:
        seen = []
        async with session.stream() as stream:
            await stream.look(width=16, height=12, renderer="flat")
            async for frame in stream:
                seen.append(frame.revision)
                if frame.revision == 1:
                    assert (await stream.edit(move("crate", translation=[0.1, 0, 0]))).revision == 2
                elif frame.converged:
                    break
            assert (await stream.undo()).revision == 3
        return seen

    async def visit() -> list[int]:
        async with AsyncClient(address, token="ann") as client, await client.open(box_document()) as session:
            return await watch(session)

    seen = asyncio.run(visit())
    assert seen == sorted(seen)
    assert seen[-1] == 2


def test_a_session_may_have_ended_before_its_context(address: str) -> None:
    with Client(address, token="ann") as client:
        with client.open(box_document()) as session:
            session.close()
        with pytest.raises(ZeroDivisionError), client.open(box_document()) as session:
            session.close()
            raise ZeroDivisionError  # and what was raised inside is not hidden
        with pytest.raises(ProblemError, match="404"):
            session.close()

    async def visit() -> None:
        async with AsyncClient(address, token="ann") as client, await client.open(box_document()) as session:
            await session.close()

    asyncio.run(visit())


def test_what_else_goes_wrong_at_the_end_of_a_context_is_told(address: str) -> None:
    with Client(address) as none, pytest.raises(ProblemError, match="401"), none.session("any"):
        pass

    async def visit() -> None:
        async with AsyncClient(address) as none, none.session("any"):
            pass

    with pytest.raises(ProblemError, match="401"):
        asyncio.run(visit())


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
