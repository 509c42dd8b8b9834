"""A session's worker that outlasts its processes, and what it holds with it.

Every request that changes a session is written into the journal before it is answered: here, and nowhere
else. One that meets the end of a process is put again to the next: had it been written, it would have been
answered. The order in which the engine takes changes and that in which they are written must be one, so that
they are made one after another.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final, TypeAlias, TypeVar, cast

from service.hosting.keeping import answer_text, digest_of, read_answer, settings_text, step_of
from service.hosting.light_keeping import LightPlace
from service.hosting.messages import (
    ApplyEdits,
    EditsAnswer,
    FrameAnswer,
    GetFrame,
    Open,
    Redo,
    Request,
    Undo,
)
from service.hosting.remote import RemoteWorker, WorkerGoneError
from service.hosting.reviving import Processes
from service.journal.documents import Snapshot, Step, read_snapshot, read_step, text_of
from service.journal.journal import Journal
from service.journal.recollection import Recollection
from service.journal.store import JournalError, Kept, KeyedAnswer, Stands, Whole
from service.session_metrics import SessionMetrics
from solver.document.limits import SceneLimits
from solver.engine.past import Past
from solver.engine.requests import FrameLimits, WaitFor
from solver.engine.status import EngineStatus
from solver.geometry.scene import Scene
from solver.illumination.settings import LightSettings

R = TypeVar("R")

Edits: TypeAlias = ApplyEdits | Undo | Redo

_FAREWELL: Final = 1.0
"""Seconds that a change may take when the session ends"""

_FOLD_AFTER: Final = 1000
"""Steps that are written one by one before a snapshot takes their place"""


class KeyUsedError(Exception):
    """A key came with another request before."""

    def __init__(self, key: str) -> None:
        self.key = key
        super().__init__("this key came with another request before")


@dataclass(frozen=True)
class Terms:
    """What holds for all sessions."""

    scene_limits: SceneLimits
    frame_limits: FrameLimits
    most_bytes: int
    """Of memory that a session may take"""
    wake_seconds: float
    """That a request waits for its session to be brought back"""

    def opening(self, scene: Scene | Past, settings: LightSettings, light: LightPlace | None = None) -> Open:
        """What a worker is told of a session."""
        return Open(scene, settings, self.scene_limits, self.frame_limits, self.most_bytes, light)


class LastingWorker:
    """The worker of one session, whichever process that is at present."""

    def __init__(
        self,
        session_id: str,
        journal: Journal,
        take: Callable[[], Awaitable[RemoteWorker]],
        terms: Terms,
        metrics: SessionMetrics,
        light: LightPlace | None = None,
    ) -> None:
        """`take` gives a process that holds no session, or raises what tells why there is none.
        `light`: where that of the session is kept."""
        self._id = session_id
        self._journal = journal
        self._terms = terms
        self._metrics = metrics
        self._light = light
        self._processes = Processes(self._opening, take, terms.wake_seconds, metrics)
        self._changing = asyncio.Lock()
        self._steps = 0

    @property
    def gone(self) -> bool:
        """Whether the session has ended for good, or cannot be brought back now."""
        return self._processes.gone

    @property
    def is_awake(self) -> bool:
        """Whether it has a process, or is about to have one."""
        return self._processes.is_awake

    @property
    def status(self) -> EngineStatus | None:
        """The latest that is known of the session; None while it sleeps."""
        return self._processes.status

    @property
    def pid(self) -> int:
        """Id of its process. Raises WorkerGoneError where it has none."""
        process = self._processes.current
        if process is None:
            raise WorkerGoneError
        return process.pid

    def attach(self, process: RemoteWorker) -> None:
        """Go on in that process, which holds what is written."""
        self._processes.attach(process)

    def rouse(self) -> None:
        """Begin to wake where it sleeps; nothing waits for it."""
        self._processes.rouse()

    async def news(self) -> None:
        """Return when the status has changed, or the process."""
        await self._processes.news()

    async def call(self, request: Request[R]) -> R:
        """The answer to `request`; what it changed is written when this returns.

        Raises RefusedError, JournalError, WorkerGoneError, and what `take` raises.
        """
        step = step_of(request)
        if step is None:
            start = time.perf_counter()
            answer, _ = await self._processes.put(request)
            if isinstance(request, GetFrame) and request.wait.until is WaitFor.NONE:
                renderer = cast("FrameAnswer", answer).outlook.renderer
                self._metrics.frames.labels(renderer).observe(time.perf_counter() - start)
            return answer
        # Whoever asked may stop to wait, but what the engine has taken must be written.
        return await asyncio.shield(self._processes.later(self._change(request, step)))

    async def call_once(self, request: Edits, key: str) -> EditsAnswer:
        """The answer to `request`, which is put once however often it comes with that key.

        Raises KeyUsedError where the key came with another request, and what `call` raises.
        """
        step = cast("Step", step_of(request))
        return await asyncio.shield(self._processes.later(self._change_once(request, step, key)))

    async def recollect(self) -> Recollection:
        """What is written of the session. Raises JournalError."""
        whole = await self._journal.run(lambda store: store.whole(self._id))
        return await asyncio.to_thread(_recollection, whole)

    async def restore(self, snapshot: Snapshot, name: str) -> None:
        """Be what `snapshot` tells from now on. Raises JournalError."""
        await asyncio.shield(self._processes.later(self._restore(snapshot, name)))

    async def sleep(self) -> None:
        """End the process until somebody needs the session. Raises JournalError."""
        async with self._changing:
            if self._processes.current is not None:
                await self._processes.put_away()
            used = time.time()
            await self._journal.run(lambda store: store.touch(self._id, used))

    async def end(self) -> None:
        """End for good; what is written stays, and what is being changed is written if it takes no time."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_FAREWELL), self._changing:
                pass
        await self._processes.end()

    async def _change(self, request: Request[R], step: Step) -> R:
        async with self._changing:
            return await self._put_and_write(request, step, None)

    async def _change_once(self, request: Edits, step: Step, key: str) -> EditsAnswer:
        digest = digest_of(request, step)
        async with self._changing:
            found = await self._journal.run(lambda store: store.answer(self._id, key))
            if found is None:
                return await self._put_and_write(request, step, (key, digest))
        if found.digest != digest:
            raise KeyUsedError(key)
        return read_answer(found.answer)

    async def _put_and_write(self, request: Request[R], step: Step, key: tuple[str, bytes] | None) -> R:
        start = time.perf_counter()
        answer, process = await self._processes.put(request)
        try:
            await self._write(answer, step, key)
        except JournalError:
            await self._processes.start_anew()  # the engine is ahead of what is written
            raise
        if process is not self._processes.current:
            await self._processes.start_anew()  # the next one may have been told before this was written
        self._metrics.changes.labels(step.step).observe(time.perf_counter() - start)
        return answer

    async def _write(self, answer: object, step: Step, key: tuple[str, bytes] | None) -> None:
        text, told = text_of(step), None
        match answer:
            case EngineStatus():
                stands = Stands(answer.revision, settings_text(answer.settings), time.time())
            case EditsAnswer():
                stands = Stands(answer.revision, None, time.time())
                told = None if key is None else KeyedAnswer(*key, answer_text(answer))
            case _:
                raise TypeError(f"{type(answer).__name__} tells no revision")
        await self._journal.run(lambda store: store.append(self._id, text, stands, told))
        self._steps += 1
        if self._steps >= _FOLD_AFTER:
            self._steps = 0
            self._processes.later(self._fold())

    async def _fold(self) -> None:
        # Where the session has been ended meanwhile, nothing is there to be folded.
        with contextlib.suppress(JournalError):
            whole = await self._journal.run(lambda store: store.whole(self._id))
            text = await asyncio.to_thread(lambda: text_of(_recollection(whole).snapshot()))
            await self._journal.run(lambda store: store.fold(self._id, text, whole.last))

    async def _restore(self, snapshot: Snapshot, name: str) -> None:
        kept = Kept(self._id, "", name, snapshot.revision, text_of(snapshot.settings), time.time())
        text = await asyncio.to_thread(text_of, snapshot)
        async with self._changing:
            await self._journal.run(lambda store: store.replace(kept, text))
            await self._processes.start_anew()

    async def _opening(self) -> Open:
        whole = await self._journal.run(lambda store: store.whole(self._id))
        self._steps = len(whole.steps)
        return await asyncio.to_thread(self._opening_of, whole)

    def _opening_of(self, whole: Whole) -> Open:
        recollection = _recollection(whole)
        return self._terms.opening(recollection.past(), recollection.settings, self._light)


def _recollection(whole: Whole) -> Recollection:
    return Recollection(read_snapshot(whole.snapshot), map(read_step, whole.steps))
