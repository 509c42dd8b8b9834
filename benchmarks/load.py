"""A service under load: many sessions, each with a client that edits it and looks at it, for some time.

    python -m benchmarks.load --sessions 32 --seconds 120
    python -m benchmarks.load --sessions 8 --seconds 60 --kill 5

Clients wait for each answer before they ask again, with a pause, as people do who drag things. With `--kill`,
a worker that is chosen at random is killed every so many seconds. At the end each session must have every
edit that was acknowledged, and be at the revision that was told last.
"""

from __future__ import annotations

import asyncio
import os
import random
import signal
import statistics
import subprocess
import time
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import httpx
import typer

from benchmarks.load_memory import Memory, memory_table, workers_of
from benchmarks.served import served

T = TypeVar("T")

_SCENES: Final = ("cornell", "cube_room")
_SIZE: Final[dict[str, str | int]] = {"width": 320, "height": 240, "format": "jpeg"}
_PATIENCE: Final = 120.0
_WEIGHED: Final = 5.0
"""Seconds between two looks at memory: each takes the system milliseconds a process."""


@dataclass
class Tally:
    """What has come of the requests."""

    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """Of each kind of request that succeeded"""
    failures: Counter[str] = field(default_factory=Counter)
    memory: list[Memory] = field(default_factory=list)
    """As time goes by"""
    kills: int = 0

    def table(self) -> str:
        """A line for each kind of request."""
        lines = [f"{'request':<8}{'number':>8}{'p50 ms':>9}{'p95 ms':>9}{'most ms':>9}"]
        for kind, seconds in sorted(self.seconds.items()):
            ms = sorted(1e3 * s for s in seconds)
            p50, p95 = statistics.median(ms), ms[min(len(ms) - 1, int(0.95 * len(ms)))]
            lines.append(f"{kind:<8}{len(ms):>8}{p50:>9.1f}{p95:>9.1f}{ms[-1]:>9.0f}")
        failed = ", ".join(f"{count} {what}" for what, count in self.failures.items()) or "none"
        lines.append(f"failures: {failed}; workers killed: {self.kills}")
        if self.memory:
            lines.append(memory_table(self.memory))
        return "\n".join(lines)


class Visitor:
    """A client with a session of its own, and what the service has acknowledged of its edits."""

    def __init__(self, http: httpx.AsyncClient, tally: Tally, number: int) -> None:
        self._http = http
        self._tally = tally
        self._chance = random.Random(number)
        self._scene = _SCENES[number % len(_SCENES)]
        self._path = ""
        self._ids: list[str] = []
        self._greys: dict[str, float] = {}
        self._revision = 1

    async def arrive(self) -> None:
        """Open the session."""
        body = {"sample": self._scene, "settings": {"error_tolerance": 0.05}}
        answer = await self._timed("open", self._http.post("/v1/sessions", json=body))
        if answer is None:
            raise RuntimeError(f"a session was refused: {dict(self._tally.failures)}")
        self._path = answer.headers["location"]
        scene = (await self._http.get(f"{self._path}/scene")).json()["scene"]
        self._ids = [o["id"] for o in scene["objects"] if not any(o["material"].get("emission", [0]))]

    async def stay(self, until: float) -> None:
        """Edit and look, until then."""
        while time.monotonic() < until:
            await self._chance.choices((self._look, self._paint, self._move, self._undo), (12, 5, 2, 1))[0]()
            await asyncio.sleep(self._chance.uniform(0.05, 0.4))

    async def check(self) -> list[str]:
        """What is not as it was acknowledged."""
        answer = (await self._http.get(f"{self._path}/scene")).json()
        if "scene" not in answer:
            return [f"{self._path}: {answer.get('detail')}"]
        found = {o["id"]: o["material"]["reflectance"][0] for o in answer["scene"]["objects"]}
        wrong = [f"{self._path}: {id}" for id, grey in self._greys.items() if found.get(id) != grey]
        if answer["revision"] != self._revision:
            wrong.append(f"{self._path}: revision {answer['revision']}, told {self._revision}")
        await self._http.delete(self._path)
        return wrong

    async def _look(self) -> None:
        renderer = self._chance.choice(("interpolant", "gouraud", "flat"))
        asked = {**_SIZE, "renderer": renderer, "vertical_fov": round(self._chance.uniform(30.0, 60.0), 1)}
        await self._timed("frame", self._http.get(f"{self._path}/frame", params=asked))

    async def _paint(self) -> None:
        id, grey = self._chance.choice(self._ids), round(self._chance.uniform(0.1, 0.8), 6)
        edit = {"op": "set_material", "id": id, "material": {"reflectance": [grey] * 3}}
        if await self._edit(edit):
            self._greys[id] = grey

    async def _move(self) -> None:
        offset = [round(self._chance.uniform(-0.02, 0.02), 6) for _ in range(3)]
        await self._edit({"op": "move", "id": self._ids[-1], "transform": {"translation": offset}})

    async def _undo(self) -> None:
        """Move something, and take that back."""
        await self._move()
        answer = await self._timed("undo", self._http.post(f"{self._path}/undo"))
        if answer is not None:
            self._revision = answer.json()["revision"]

    async def _edit(self, edit: dict[str, Any]) -> bool:
        answer = await self._timed("edit", self._http.post(f"{self._path}/edits", json={"edits": [edit]}))
        if answer is not None:
            self._revision = answer.json()["revision"]
        return answer is not None

    async def _timed(self, kind: str, request: Awaitable[httpx.Response]) -> httpx.Response | None:
        start = time.perf_counter()
        try:
            answer = await request
        except httpx.TransportError as lost:
            self._tally.failures[f"{kind}: {type(lost).__name__}"] += 1
            return None
        if not answer.is_success:
            self._tally.failures[f"{kind}: {answer.status_code}"] += 1
            return None
        self._tally.seconds[kind].append(time.perf_counter() - start)
        return answer


async def load(sessions: int, seconds: float, kill: float | None, directory: Path | None) -> Tally:
    """Start a service, have it visited, and end it. Raises RuntimeError where an edit was lost."""
    tally = Tally()
    async with _service(sessions, directory) as (http, process):
        visitors = [Visitor(http, tally, number) for number in range(sessions)]
        for visitor in visitors:
            await visitor.arrive()
        until = time.monotonic() + seconds
        others = [asyncio.create_task(_weigh(process.pid, tally))]
        if kill is not None:
            chance = random.Random(1)
            others.append(asyncio.create_task(_every(kill, lambda: _kill(process.pid, tally, chance))))
        await asyncio.gather(*(visitor.stay(until) for visitor in visitors))
        for task in others:
            task.cancel()
        lost = [wrong for visitor in visitors for wrong in await visitor.check()]
    if lost:
        raise RuntimeError("not as it was acknowledged: " + "; ".join(lost))
    return tally


@asynccontextmanager
async def _service(
    sessions: int, directory: Path | None
) -> AsyncIterator[tuple[httpx.AsyncClient, subprocess.Popen[str]]]:
    settings = {"MAX_SESSIONS": str(sessions), "WAKE_SECONDS": str(_PATIENCE)}
    if directory is not None:
        settings["DATA_DIR"] = str(directory)
    limits = httpx.Limits(max_connections=2 * sessions)
    # Nothing else runs while the service starts and ends.
    with served(**settings) as (address, process):
        async with httpx.AsyncClient(base_url=address, timeout=_PATIENCE, limits=limits) as http:
            yield http, process


async def _every(seconds: float, act: Callable[[], Any]) -> None:
    while True:
        await asyncio.sleep(seconds)
        act()


def _kill(service: int, tally: Tally, chance: random.Random) -> None:
    workers = workers_of(service)
    if workers:
        os.kill(chance.choice(workers), signal.SIGKILL)
        tally.kills += 1


async def _weigh(service: int, tally: Tally) -> None:
    while True:
        tally.memory.append(await asyncio.to_thread(Memory.of, service))
        await asyncio.sleep(_WEIGHED)


def main(
    sessions: Annotated[int, typer.Option(min=1, max=64, help="Sessions, each with its client.")] = 8,
    seconds: Annotated[float, typer.Option(min=1.0, max=3600.0, help="Of load.")] = 30.0,
    kill: Annotated[float | None, typer.Option(min=0.2, help="Seconds between two workers' ends.")] = None,
    directory: Annotated[Path | None, typer.Option(help="Keep sessions there; else in memory.")] = None,
) -> None:
    """Load a service of its own, and show what its clients waited for."""
    print(asyncio.run(load(sessions, seconds, kill, directory)).table())


if __name__ == "__main__":
    typer.run(main)
