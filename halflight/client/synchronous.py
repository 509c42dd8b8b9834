"""The client that blocks."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self, TypeVar

import httpx
from numpy.typing import ArrayLike

from halflight.client import calls
from halflight.client.answers import Edited, Frame, LogEntry, Picked, Probed, Status
from halflight.client.calls import Call
from halflight.client.conversation import address_of
from halflight.client.edits import Edit
from halflight.client.errors import ProblemError
from halflight.client.streams import Stream

T = TypeVar("T")

_FIRST_LOOK, _LONGEST_LOOK = 0.02, 0.5
"""Seconds between two looks at how a session stands"""


class Client:
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
        self._http = httpx.Client(base_url=address, headers=headers, timeout=timeout)
        self._patience = patience

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Hang up. Sessions stay."""
        self._http.close()

    def open(
        self,
        scene: Mapping[str, Any] | None = None,
        sample: str | None = None,
        snapshot: Mapping[str, Any] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> Session:
        """A new session of a scene document, of a scene that ships with the service, or of a snapshot."""
        given = {"scene": scene, "sample": sample, "snapshot": snapshot, "settings": settings}
        body = {name: value for name, value in given.items() if value is not None}
        return Session(self, self.do(calls.open_session(body)).id)

    def session(self, id: str) -> Session:
        """A session that exists."""
        return Session(self, id)

    def sessions(self) -> list[Status]:
        """How all sessions stand."""
        return self.do(calls.sessions())

    def stream(self, path: str) -> Stream:
        """The stream of the session of that path."""
        return Stream(address_of(self._address, path), self._headers, self._timeout)

    def do(self, call: Call[T]) -> T:
        """Make a call, and again where that helps."""
        deadline = time.monotonic() + self._patience
        while True:
            answer = failure = None
            try:
                answer = self._http.request(
                    call.method, call.path, json=call.json, params=call.query, headers=call.headers
                )
            except httpx.TransportError as lost:
                failure = lost
            pause = call.pause(answer)
            if pause is None or time.monotonic() + pause > deadline:
                if answer is not None:
                    return call.answered(answer)
                raise failure or ProblemError(0, "about:blank", "no answer", [])
            time.sleep(pause)


class Session:
    """A scene that is being lit. As a context it is ended at its end, unless it has
    ended before."""

    def __init__(self, client: Client, id: str) -> None:
        self.id = id
        self._client = client
        self._path = f"/v1/sessions/{id}"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except ProblemError as refused:
            if refused.status != calls.NOT_THERE:
                raise

    def status(self) -> Status:
        """How it stands."""
        return self._client.do(calls.status(self._path))

    def scene(self) -> dict[str, Any]:
        """The scene document as it stands."""
        return self._client.do(calls.scene(self._path))

    def configure(self, **settings: Any) -> Status:
        """Change settings, as `error_tolerance=0.01`."""
        return self._client.do(calls.configure(self._path, settings))

    def edit(self, *edits: Edit, if_revision: int | None = None) -> Edited:
        """Apply all of `edits`, or none; the light follows."""
        return self._client.do(calls.edit(self._path, edits, if_revision))

    def undo(self) -> Edited:
        """Take back the newest batch."""
        return self._client.do(calls.reverse(self._path, "undo"))

    def redo(self) -> Edited:
        """Bring back the batch that was taken back last."""
        return self._client.do(calls.reverse(self._path, "redo"))

    def log(self) -> list[LogEntry]:
        """The change log, oldest entries first."""
        return self._client.do(calls.log(self._path))

    def wait(self, timeout: float = 600.0) -> Status:
        """How it stands once its light rests: converged, paused or failed. Raises TimeoutError."""
        deadline, look = time.monotonic() + timeout, _FIRST_LOOK
        while not (status := self.status()).rests:
            if time.monotonic() + look > deadline:
                raise TimeoutError(f"session {self.id} still solves after {timeout:g} s")
            time.sleep(look)
            look = min(2.0 * look, _LONGEST_LOOK)
        return status

    def frame(self, camera: str | None = None, **query: Any) -> Frame:
        """A frame; the query is the interface's: `format`, `wait`, `width`, `eye=[1, 2, 3]`, and so on."""
        return self._client.do(calls.frame(self._path, {"camera": camera, **query}))

    def stream(self) -> Stream:
        """Frames as they become better, and edits in between, over a connection that is kept."""
        return self._client.stream(self._path)

    def pick(self, x: int, y: int, camera: str | None = None, **query: Any) -> Picked:
        """What a pixel shows, in column `x` and row `y`, from 0 at the top left."""
        return self._client.do(calls.pick(self._path, x, y, {"camera": camera, **query}))

    def probe(self, positions: ArrayLike, normals: ArrayLike) -> Probed:
        """The light at points (n, 3), in metres, with normals (n, 3), or one normal for all."""
        return self._client.do(calls.probe(self._path, positions, normals))

    def snapshot(self) -> dict[str, Any]:
        """All of it but its light, to be kept, and opened again."""
        return self._client.do(calls.snapshot(self._path))

    def close(self) -> None:
        """End it, and free all that it holds."""
        self._client.do(calls.close(self._path))
