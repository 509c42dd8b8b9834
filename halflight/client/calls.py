"""The calls of the interface: what is sent, and how the answer is read. Both clients make them."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Generic, TypeVar

import httpx
from numpy.typing import ArrayLike, NDArray

from halflight.client.answers import Edited, Frame, LogEntry, Picked, Probed, Status
from halflight.client.edits import Edit
from halflight.client.errors import ProblemError

T = TypeVar("T")

_AGAIN: Final = frozenset({429, 503})
"""Status codes of what may succeed later"""

NOT_THERE: Final = 404
"""Status code of a session that has ended"""

_PAUSE: Final = 0.25
"""Seconds before a request is sent again where the service does not say"""


@dataclass(frozen=True)
class Call(Generic[T]):
    """A request, and how its answer is read."""

    method: str
    path: str
    read: Callable[[httpx.Response], T]
    json: Any = None
    query: Mapping[str, Any] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)

    def answered(self, answer: httpx.Response) -> T:
        """What the answer tells. Raises ProblemError."""
        if answer.is_error:
            raise ProblemError.of(answer)
        return self.read(answer)

    def pause(self, answer: httpx.Response | None) -> float | None:
        """Seconds after which it may be sent again, after that answer or none; None where it may not."""
        if answer is None:
            return _PAUSE  # which does no harm: what changes something has a key
        # What is refused so was not begun.
        wait = answer.headers.get("retry-after", "")
        return float(wait) if answer.status_code in _AGAIN and wait.isdigit() else None


def _key() -> dict[str, str]:
    return {"Idempotency-Key": uuid.uuid4().hex}


def _json(read: Callable[[Any], T]) -> Callable[[httpx.Response], T]:
    return lambda answer: read(answer.json())


def open_session(body: Mapping[str, Any]) -> Call[Status]:
    """Open a session."""
    return Call("POST", "/v1/sessions", _json(Status.of), body, headers=_key())


def sessions() -> Call[list[Status]]:
    """List the sessions."""
    return Call("GET", "/v1/sessions", _json(lambda told: [Status.of(one) for one in told["sessions"]]))


def status(path: str) -> Call[Status]:
    """How a session stands."""
    return Call("GET", path, _json(Status.of))


def close(path: str) -> Call[None]:
    """End a session."""
    return Call("DELETE", path, lambda _: None)


def scene(path: str) -> Call[dict[str, Any]]:
    """The scene as it stands."""
    return Call("GET", f"{path}/scene", _json(lambda told: dict(told["scene"])))


def configure(path: str, settings: Mapping[str, Any]) -> Call[Status]:
    """Change settings."""
    return Call("PATCH", f"{path}/settings", _json(Status.of), settings)


def edit(path: str, edits: Sequence[Edit], if_revision: int | None) -> Call[Edited]:
    """Apply a batch."""
    body = {"edits": list(edits)} | ({} if if_revision is None else {"if_revision": if_revision})
    return Call("POST", f"{path}/edits", _json(Edited.of), body, headers=_key())


def reverse(path: str, what: str) -> Call[Edited]:
    """Undo or redo."""
    return Call("POST", f"{path}/{what}", _json(Edited.of), headers=_key())


def log(path: str) -> Call[list[LogEntry]]:
    """The change log."""
    return Call("GET", f"{path}/log", _json(lambda told: [LogEntry.of(entry) for entry in told["entries"]]))


def frame(path: str, query: Mapping[str, Any]) -> Call[Frame]:
    """A frame; triples may be sequences."""
    return Call("GET", f"{path}/frame", Frame.of, query=_spelt(query))


def pick(path: str, x: int, y: int, query: Mapping[str, Any]) -> Call[Picked]:
    """What a pixel shows."""
    return Call("GET", f"{path}/pick", _json(Picked.of), query=_spelt(query) | {"x": x, "y": y})


def probe(path: str, positions: ArrayLike, normals: ArrayLike) -> Call[Probed]:
    """The light at points (n, 3) with normals (n, 3), or one for all."""
    import numpy as np

    places: NDArray[np.float64] = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
    facing = np.broadcast_to(np.asarray(normals, dtype=np.float64), places.shape)
    points = [
        {"position": place, "normal": normal}
        for place, normal in zip(places.tolist(), facing.tolist(), strict=True)
    ]
    return Call("POST", f"{path}/probe", _json(Probed.of), {"points": points})


def snapshot(path: str) -> Call[dict[str, Any]]:
    """All of a session but its light."""
    return Call("GET", f"{path}/snapshot", _json(dict))


def _spelt(query: Mapping[str, Any]) -> dict[str, Any]:
    """A query as an address holds it."""
    return {
        name: ",".join(map(str, value)) if isinstance(value, list | tuple) else value
        for name, value in query.items()
        if value is not None
    }
