"""The client for programs of asyncio: `Client` with `await`."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self, TypeVar

import httpx
from numpy.typing import ArrayLike

from halflight.client import calls
from halflight.client.answers import Edited, Frame, LogEntry, Picked, Probed, Status
from halflight.client.asynchronous_streams import AsyncStream
from halflight.client.calls import Call
from halflight.client.conversation import address_of
from halflight.client.edits import Edit
from halflight.client.errors import ProblemError

T = TypeVar("T")

_FIRST_LOOK, _LONGEST_LOOK = 0.02, 0.5
"""Seconds between two looks at how a session stands"""


class AsyncClient:
    """A service. Every method may raise ProblemError, and httpx.TransportError where nobody answers."""

    def __init__(
        self,
        address: str = "http://127.0.0.1:8000",
        token: str | None = None,
        timeout: float = 60.0,
        patience: float = 30.0,
    ) -> None:
        """`timeout`: seconds until an answer must have begun. `patience`: seconds for which what is refused
        for now, or has met no answer, is sent again."""
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._address, self._headers, self._timeout = address, headers, timeout
        self._http = httpx.AsyncClient(base_url=address, headers=headers, timeout=timeout)
        self._patience = patience

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Hang up. Sessions stay."""
        await self._http.aclose()

    async def open(
        self,
        scene: Mapping[str, Any] | None = None,
        sample: str | None = None,
        snapshot: Mapping[str, Any] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> AsyncSession:
        """A new session of a scene document, of a scene that ships with the service, or of a snapshot."""
        given = {"scene": scene, "sample": sample, "snapshot": snapshot, "settings": settings}
        body = {name: value for name, value in given.items() if value is not None}
        return AsyncSession(self, (await self.do(calls.open_session(body))).id)

    def session(self, id: str) -> AsyncSession:
        """A session that exists."""
        return AsyncSession(self, id)

    async def sessions(self) -> list[Status]:
        """How all sessions stand."""
        return await self.do(calls.sessions())

    def stream(self, path: str) -> AsyncStream:
        """The stream of the session of that path."""
        return AsyncStream(address_of(self._address, path), self._headers, self._timeout)

    async def do(self, call: Call[T]) -> T:
        """Make a call, and again where that helps."""
        deadline = time.monotonic() + self._patience
        while True:
            answer = failure = None
            try:
                answer = await self._http.request(
                    call.method, call.path, json=call.json, params=call.query, headers=call.headers
                )
            except httpx.TransportError as lost:
                failure = lost
            pause = call.pause(answer)
            if pause is None or time.monotonic() + pause > deadline:
                if answer is not None:
                    return call.answered(answer)
                raise failure or ProblemError(0, "about:blank", "no answer", [])
            await asyncio.sleep(pause)


class AsyncSession:
    """A scene that is being lit. As a context it is ended at its end, unless it has
    ended before."""

    def __init__(self, client: AsyncClient, id: str) -> None:
        self.id = id
        self._client = client
        self._path = f"/v1/sessions/{id}"

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            await self.close()
        except ProblemError as refused:
            if refused.status != calls.NOT_THERE:
                raise

    async def status(self) -> Status:
        """How it stands."""
        return await self._client.do(calls.status(self._path))

    async def scene(self) -> dict[str, Any]:
        """The scene document as it stands."""
        return await self._client.do(calls.scene(self._path))

    async def configure(self, **settings: Any) -> Status:
        """Change settings, as `error_tolerance=0.01`."""
        return await self._client.do(calls.configure(self._path, settings))

    async def edit(self, *edits: Edit, if_revision: int | None = None) -> Edited:
        """Apply all of `edits`, or none; the light follows."""
        return await self._client.do(calls.edit(self._path, edits, if_revision))

    async def undo(self) -> Edited:
        """Take back the newest batch."""
        return await self._client.do(calls.reverse(self._path, "undo"))

    async def redo(self) -> Edited:
        """Bring back the batch that was taken back last."""
        return await self._client.do(calls.reverse(self._path, "redo"))

    async def log(self) -> list[LogEntry]:
        """The change log, oldest entries first."""
        return await self._client.do(calls.log(self._path))

    async def wait(self, timeout: float = 600.0) -> Status:
        """How it stands once its light rests: converged, paused or failed. Raises TimeoutError."""
        deadline, look = time.monotonic() + timeout, _FIRST_LOOK
        while not (status := await self.status()).rests:
            if time.monotonic() + look > deadline:
                raise TimeoutError(f"session {self.id} still solves after {timeout:g} s")
            await asyncio.sleep(look)
            look = min(2.0 * look, _LONGEST_LOOK)
        return status

    async def frame(self, camera: str | None = None, **query: Any) -> Frame:
        """A frame; the query is the interface's: `format`, `wait`, `width`, `eye=[1, 2, 3]`, and so on."""
        return await self._client.do(calls.frame(self._path, {"camera": camera, **query}))

    def stream(self) -> AsyncStream:
        """Frames as they become better, and edits in between, over a connection that is kept."""
        return self._client.stream(self._path)

    async def pick(self, x: int, y: int, camera: str | None = None, **query: Any) -> Picked:
        """What a pixel shows, in column `x` and row `y`, from 0 at the top left."""
        return await self._client.do(calls.pick(self._path, x, y, {"camera": camera, **query}))

    async def probe(self, positions: ArrayLike, normals: ArrayLike) -> Probed:
        """The light at points (n, 3), in metres, with normals (n, 3), or one normal for all."""
        return await self._client.do(calls.probe(self._path, positions, normals))

    async def snapshot(self) -> dict[str, Any]:
        """All of it but its light, to be kept, and opened again."""
        return await self._client.do(calls.snapshot(self._path))

    async def close(self) -> None:
        """End it, and free all that it holds."""
        await self._client.do(calls.close(self._path))
