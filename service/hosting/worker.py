"""The worker process: one engine, its GL context and its threads, at the end of a socket.

The main thread alternates between serving requests and slices of the engine's work. A second thread
does nothing but read, so that the process ends at once when the web process has gone, whatever the
main thread is doing. A third one, once it is needed, encodes frames, so that the work goes on meanwhile.
"""

from __future__ import annotations

import os
import queue
import socket
import sys
import threading
import time
from typing import Final, NoReturn

from service.hosting.answers import CHANGING, REFUSED, answer, refusal_of
from service.hosting.board import Turn
from service.hosting.encoding import Encoder, PendingFrame
from service.hosting.light_keeping import LightKeeper
from service.hosting.memory_limit import MemoryLimit
from service.hosting.messages import (
    Abandon,
    Answer,
    AnyRequest,
    Call,
    GetExport,
    GetFrame,
    GetGrid,
    GetLightmap,
    GetOverlay,
    Open,
    Ready,
    StatusChanged,
    ToWorker,
)
from service.hosting.spare_memory import SpareMemory
from service.hosting.waiting import Waiting, WaitingExport, WaitingFrame, WaitingLightmap, WaitingOverlay
from service.hosting.wire import WorkerEnd
from solver.engine.drawing import Drawing
from solver.engine.engine import Engine
from solver.engine.status import EngineStatus

SLICE: Final = 0.02
"""Seconds of work between two looks at the requests."""

REPORT_INTERVAL: Final = 0.1
"""Seconds between two reports while only the numbers of the status change."""


_SWITCH: Final = 0.0005
"""Seconds after which a thread leaves the interpreter to another that waits. A file that is encoded beside
the work asks for it some dozens of times; by the default of 5 ms, a PNG would take twice its time."""


class Host:
    """Serves the requests to one engine, and works on it in between."""

    def __init__(
        self, end: WorkerEnd, inbox: queue.SimpleQueue[ToWorker], drawing: Drawing, turn: Turn
    ) -> None:
        self._end = end
        self._inbox = inbox
        self._drawing = drawing
        self._turn = turn
        self._engine: Engine | None = None
        self._waiting: dict[int, Waiting] = {}
        self._busy = False
        self._reported: EngineStatus | None = None
        self._report_due = 0.0
        self._keeper = LightKeeper(None)
        self._memory: MemoryLimit | None = None
        self._spare = SpareMemory()
        self._encoder = Encoder(end.send)

    def run(self) -> NoReturn:
        """Serve for ever: the reading thread ends the process."""
        while True:
            arrived = self._arrived()
            for message in arrived:
                self._serve(message)
            if self._engine is not None:
                if arrived or self._is_busy:
                    self._spare.note()
                self._serve_waiting(self._engine)
                self._work(self._engine)
                self._keeper.keep(self._engine)
                self._spare.give_back()
                if not self._is_busy:
                    self._serve_waiting(self._engine)  # nothing will get better while this sleeps

    def _arrived(self) -> list[ToWorker]:
        """What has come; where there is nothing else to do, this waits for it."""
        messages = []
        try:
            timeout = self._turn.delay() if self._is_busy else self._spare_time()
            if timeout != 0.0:
                messages.append(self._inbox.get(timeout=timeout))
            while True:
                messages.append(self._inbox.get_nowait())
        except queue.Empty:
            return messages

    @property
    def _is_busy(self) -> bool:
        """Whether there is work to do without any message."""
        return self._busy or any(waiting.is_working for waiting in self._waiting.values())

    def _spare_time(self) -> float | None:
        """Seconds until a waiting request must be answered, light be kept, or memory be given back; None:
        there is nothing of these."""
        times = [waiting.deadline for waiting in self._waiting.values()]
        times += [due for due in (self._keeper.due, self._spare.due) if due is not None]
        return max(0.0, min(times) - time.monotonic()) if times else None

    def _serve(self, message: ToWorker) -> None:
        match message:
            case Abandon(number):
                self._waiting.pop(number, None)
                self._encoder.give_up(number)
            case Call(number, GetFrame() as request):
                self._waiting[number] = WaitingFrame(request)
            case Call(number, GetOverlay() as request):
                self._waiting[number] = WaitingOverlay(request, SLICE)
            case Call(number, GetLightmap() as request):
                self._waiting[number] = WaitingLightmap(request, SLICE)
            case Call(number, (GetExport() | GetGrid()) as request):
                self._waiting[number] = WaitingExport(request)
            case Call(number, request):
                value = self._answer(request)
                self._report()
                self._end.send(Answer(number, value))

    def _answer(self, request: AnyRequest) -> object:
        try:
            if self._engine is not None:
                if isinstance(request, CHANGING):
                    self._keeper.give_up()
                return answer(self._engine, request)
            if isinstance(request, Open):
                return self._open(request)
            raise TypeError(f"{type(request).__name__} came before Open")
        except REFUSED as error:
            return refusal_of(error)

    def _open(self, request: Open) -> EngineStatus:
        self._keeper = LightKeeper(request.light)
        self._memory = MemoryLimit(request.most_bytes)
        limits, drawing, kept = request.limits, self._drawing, self._keeper.read()
        self._engine = Engine(request.scene, request.settings, limits, drawing, request.frame_limits, kept)
        return self._engine.status()

    def _serve_waiting(self, engine: Engine) -> None:
        """Answer what can be answered, or whose time is up."""
        for number, waiting in tuple(self._waiting.items()):
            try:
                value = waiting.poll(engine)
            except REFUSED as error:
                value = refusal_of(error)
            if value is None:
                continue
            del self._waiting[number]
            self._report()  # what an answer tells must not be ahead of the status
            if isinstance(value, PendingFrame):
                self._encoder.put(number, value)
            else:
                self._end.send(Answer(number, value))

    def _work(self, engine: Engine) -> None:
        was_busy = self._busy
        if self._turn.delay() > 0.0:
            self._busy = True  # for all that is known
            return
        self._busy = engine.step(SLICE)
        if self._memory is not None and self._memory.is_passed():
            engine.halt(self._memory.reason)
            self._busy = False
        self._turn.worked(self._busy)
        if was_busy and not self._busy:
            self._keeper.has_built()
        if self._busy != was_busy or (self._busy and time.monotonic() >= self._report_due):
            self._report()

    def _report(self) -> None:
        """Tell the status, if it is not what was told last."""
        if self._engine is None:
            return
        status = self._engine.status()
        self._keeper.note(status.state)
        if status != self._reported:
            self._reported = status
            self._end.send(StatusChanged(status))
        self._report_due = time.monotonic() + REPORT_INTERVAL


def _read(end: WorkerEnd, inbox: queue.SimpleQueue[ToWorker]) -> None:
    """Fill `inbox`, and end the process when the web process has hung up."""
    while (message := end.receive()) is not None:
        inbox.put(message)
    os._exit(0)


def main(descriptor: int, board: int) -> NoReturn:
    """Be a worker on the socket of that file descriptor, with that board, in a process of its own."""
    sys.setswitchinterval(_SWITCH)
    end = WorkerEnd(socket.socket(fileno=descriptor))
    inbox: queue.SimpleQueue[ToWorker] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(end, inbox), name="halflight-reader", daemon=True).start()
    drawing = Drawing()
    end.send(Ready(drawing.problem))
    Host(end, inbox, drawing, Turn(board)).run()
