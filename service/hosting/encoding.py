"""Frames become files beside the work on light: one thread of a worker does nothing else.

What has been drawn is the worker's no more, so that nothing of it waits for anything. Only few frames are
handed over at a time, in their order: where more come than can be encoded, the worker waits. A frame that
nobody waits for any more is left out. Files that are made at once are made at once, since a thread would have
to wait for the interpreter longer than that takes.
"""

from __future__ import annotations

import os
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from service.hosting.answers import REFUSED, DrawnFrame, refusal_of
from service.hosting.messages import Answer
from solver.engine.frame_times import FrameTimes
from solver.rendering.encoding import LinearFormat, PictureFormat

_MOST: Final = 2
"""Frames that wait to be encoded"""

_AT_ONCE: Final = frozenset({PictureFormat.JPEG, LinearFormat.NPY})
"""Formats of files that take a few milliseconds"""


@dataclass(frozen=True)
class PendingFrame:
    """A frame that has been drawn for a request."""

    drawn: DrawnFrame
    begun: float
    """When drawing it was begun, by the monotonic clock"""
    times: FrameTimes
    """Where to tell what it cost"""

    def answer(self, number: int) -> Answer:
        """The answer to the request of that number."""
        try:
            value: object = self.drawn.encoded()
        except REFUSED as error:
            value = refusal_of(error)
        self.times.learn(time.monotonic() - self.begun)
        return Answer(number, value)


class Encoder:
    """Encodes frames, and sends them."""

    def __init__(self, send: Callable[[Answer], None]) -> None:
        """`send` is called from any thread."""
        self._send = send
        self._pending: OrderedDict[int, PendingFrame] = OrderedDict()
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def put(self, number: int, frame: PendingFrame) -> None:
        """Encode `frame`, and send it as the answer to that request; some of it may come later."""
        if frame.drawn.format in _AT_ONCE:
            self._send(frame.answer(number))
            return
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="halflight-encoder", daemon=True)
            self._thread.start()
        with self._changed:
            self._changed.wait_for(lambda: len(self._pending) < _MOST)
            self._pending[number] = frame
            self._changed.notify_all()

    def give_up(self, number: int) -> None:
        """Nobody waits for the answer to that request any more."""
        with self._changed:
            self._pending.pop(number, None)
            self._changed.notify_all()

    def _run(self) -> None:
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: bool(self._pending))
                    number, frame = self._pending.popitem(last=False)
                    self._changed.notify_all()
                self._send(frame.answer(number))
                del frame
        except Exception as failure:
            traceback.print_exception(failure)
            raise
        finally:
            os._exit(1)  # as where the thread that serves ends: who waits is to be told
