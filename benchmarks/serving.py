"""What a client waits for: a first frame, an answer to an edit, a frame as a file, over HTTP on loopback.

The service runs as `halflight serve` does, in its own processes, with a client that keeps its connection.
"""

from __future__ import annotations

import json
import re
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from typing import Any, Final

import httpx

from benchmarks.plan import Job, Options, Section
from benchmarks.served import served
from benchmarks.tables import Row, Table, Target

SCENE: Final = "cornell"
FIRST_FRAME: Final = 300.0
"""Target: ms from sending the POST to having the first frame of a new session"""

_SIZE: Final = {"width": 640, "height": 480}
_PATIENCE: Final = 60.0
_CALM: Final = 0.5
"""Seconds between two first frames, for the pool to have its worker ready and the cores free"""


@dataclass(frozen=True)
class Latency:
    """How long some requests took, ms."""

    what: str
    median: float
    least: float
    most: float
    times: int

    @staticmethod
    def of(what: str, seconds: list[float]) -> Latency:
        """Of some measurements."""
        ms = [1e3 * s for s in seconds]
        return Latency(what, statistics.median(ms), min(ms), max(ms), len(ms))


@dataclass(frozen=True)
class ServiceFigures:
    """What a client waits for."""

    created: Latency
    """POST until its answer"""
    first_frame: Latency
    """POST until the first frame is here"""
    edit: Latency
    """An edit while the solve runs, until its answer"""
    frame_after_edit: Latency
    """An edit while the solve runs, until a frame of its revision is here"""
    frame: Latency
    """A frame from a new camera of a settled session"""
    jpeg: Latency

    @property
    def all(self) -> tuple[Latency, ...]:
        """In the order of the table."""
        return self.created, self.first_frame, self.edit, self.frame_after_edit, self.frame, self.jpeg


def measure_service(times: int) -> ServiceFigures:
    """Start the service, be its only client, and end it."""
    with _service() as client:
        created, first = _new_sessions(client, times)
        edit, frame_after_edit = _edits(client, times)
        return ServiceFigures(
            Latency.of(f"new {SCENE} session: its status", created),
            Latency.of(f"new {SCENE} session: first frame, png", first),
            Latency.of("edit while solving: its answer", edit),
            Latency.of("edit while solving: frame of it, png", frame_after_edit),
            Latency.of("frame of a settled session, png", _frames(client, "png", 4 * times)),
            Latency.of("frame of a settled session, jpeg", _frames(client, "jpeg", 4 * times)),
        )


def _new_sessions(client: httpx.Client, times: int) -> tuple[list[float], list[float]]:
    scene = json.loads(resources.files("solver").joinpath("samples", f"{SCENE}.json").read_text())
    created, first = [], []
    for _ in range(times):
        _wait_for_pool(client)
        start = time.perf_counter()
        session = _open(client, {"scene": scene})
        created.append(time.perf_counter() - start)
        client.get(f"{session}/frame", params=_SIZE).raise_for_status()
        first.append(time.perf_counter() - start)
        client.delete(session).raise_for_status()
    return created, first


def _edits(client: httpx.Client, times: int) -> tuple[list[float], list[float]]:
    """Of a session that would solve for long: each edit meets a solve at another moment."""
    session = _open(client, {"sample": "office", "settings": {"error_tolerance": 1e-3}})
    crate = client.get(f"{session}/scene").raise_for_status().json()["scene"]["objects"][-1]["id"]
    answered, shown = [], []
    for number in range(1, times + 1):
        time.sleep(0.15 + 0.07 * (number % 5))
        if client.get(session).json()["state"] != "solving":
            raise RuntimeError("the session that was to be edited while it solves does not solve")
        transform = {"translation": [0.0, 0.0, 0.001 * number]}
        start = time.perf_counter()
        edits = {"edits": [{"op": "move", "id": crate, "transform": transform}]}
        client.post(f"{session}/edits", json=edits).raise_for_status()
        answered.append(time.perf_counter() - start)
        client.get(f"{session}/frame", params=_SIZE).raise_for_status()
        shown.append(time.perf_counter() - start)
    client.delete(session).raise_for_status()
    return answered, shown


def _frames(client: httpx.Client, picture: str, times: int) -> list[float]:
    session = _open(client, {"sample": SCENE})
    asked: dict[str, str | int] = {**_SIZE, "format": picture}
    client.get(f"{session}/frame", params={**asked, "wait": "converged"}).raise_for_status()
    seconds = []
    for number in range(times):
        start = time.perf_counter()
        params = {**asked, "vertical_fov": 35.0 + 0.1 * number}
        client.get(f"{session}/frame", params=params).raise_for_status()
        seconds.append(time.perf_counter() - start)
    client.delete(session).raise_for_status()
    return seconds


def _open(client: httpx.Client, request: dict[str, Any]) -> str:
    return str(client.post("/v1/sessions", json=request).raise_for_status().headers["location"])


def _wait_for_pool(client: httpx.Client) -> None:
    deadline = time.monotonic() + _PATIENCE
    while not re.search(r"halflight_warm_workers [1-9]", client.get("/metrics").text):
        if time.monotonic() > deadline:
            raise TimeoutError("the service has no worker ready")
        time.sleep(0.05)
    time.sleep(_CALM)


@contextmanager
def _service() -> Iterator[httpx.Client]:
    """A service on a free port, with the settings that it has by default."""
    with served() as (address, _), httpx.Client(base_url=address, timeout=_PATIENCE) as client:
        yield client


def section(options: Options) -> Section:
    """One service."""
    return Section("service", (Job("service", measure_service, (4 if options.quick else 10,)),), tabulate)


def tabulate(found: list[ServiceFigures]) -> Table:
    """One row a request."""
    (figures,) = found
    return Table(
        "What a client waits for",
        ("request", "median ms", "least", "most", "times"),
        tuple(
            Row(
                (f.what, f"{f.median:.1f}", f"{f.least:.1f}", f"{f.most:.1f}", str(f.times)),
                (Target("first frame", f.median, FIRST_FRAME, "ms"),) if f is figures.first_frame else (),
            )
            for f in figures.all
        ),
        "Frames are 640x480, drawn by the default renderer. Over HTTP on loopback, from sending the request "
        "to having read its answer; where two requests are made, both.",
    )
