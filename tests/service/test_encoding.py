"""Frames are encoded beside the work, few at a time, in their order."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass, field
from typing import cast

import pytest

from service.hosting.answers import DrawnFrame
from service.hosting.encoding import Encoder, PendingFrame
from service.hosting.messages import Answer, FrameAnswer, Refusal, RefusalKind
from solver.engine.frame_times import FrameTimes
from solver.rendering.encoding import EncodingError, LinearFormat, PictureFormat

PATIENCE = 10.0


@dataclass(eq=False)
class Slow:
    """A frame that is encoded when it may be."""

    format: PictureFormat | LinearFormat = PictureFormat.PNG
    may: threading.Event = field(default_factory=threading.Event)
    begun: threading.Event = field(default_factory=threading.Event)

    def encoded(self) -> FrameAnswer:
        self.begun.set()
        assert self.may.wait(PATIENCE)
        if self.format is LinearFormat.HDR:
            raise EncodingError(LinearFormat.HDR, "not this one")
        return cast("FrameAnswer", threading.current_thread().name)


@pytest.fixture
def sent() -> queue.SimpleQueue[Answer]:
    return queue.SimpleQueue()


@pytest.fixture
def encoder(sent: queue.SimpleQueue[Answer]) -> Encoder:
    return Encoder(sent.put)


def pending(frame: Slow, times: FrameTimes | None = None) -> PendingFrame:
    return PendingFrame(cast("DrawnFrame", frame), 0.0, times or FrameTimes())


def test_answers_come_later_and_in_their_order(encoder: Encoder, sent: queue.SimpleQueue[Answer]) -> None:
    frames = [Slow() for _ in range(3)]
    times = FrameTimes()
    for number, frame in enumerate(frames):
        encoder.put(number, pending(frame, times))
    assert frames[0].begun.wait(PATIENCE)
    assert sent.empty()
    assert times.expected == 0.0
    for frame in reversed(frames):
        frame.may.set()
    answers = [sent.get(timeout=PATIENCE) for _ in frames]
    assert [answer.number for answer in answers] == [0, 1, 2]
    assert {answer.value for answer in answers} == {"halflight-encoder"}
    assert times.expected > 0.0


def test_what_takes_no_time_is_done_at_once(encoder: Encoder, sent: queue.SimpleQueue[Answer]) -> None:
    frame = Slow(PictureFormat.JPEG)
    frame.may.set()
    encoder.put(7, pending(frame))
    assert sent.get_nowait() == Answer(7, threading.current_thread().name)


def test_what_nobody_waits_for_is_left_out(encoder: Encoder, sent: queue.SimpleQueue[Answer]) -> None:
    first, second, third = frames = [Slow() for _ in range(3)]
    for number, frame in enumerate(frames):
        encoder.put(number, pending(frame))
    assert first.begun.wait(PATIENCE)
    encoder.give_up(1)
    encoder.give_up(99)
    for frame in frames:
        frame.may.set()
    assert [sent.get(timeout=PATIENCE).number for _ in range(2)] == [0, 2]
    assert not second.begun.is_set()
    assert third.begun.is_set()


def test_few_are_handed_over_at_a_time(encoder: Encoder, sent: queue.SimpleQueue[Answer]) -> None:
    frames = [Slow() for _ in range(5)]

    def hand_over() -> None:
        for number, frame in enumerate(frames):
            encoder.put(number, pending(frame))

    worker = threading.Thread(target=hand_over)
    worker.start()
    assert frames[0].begun.wait(PATIENCE)
    worker.join(0.1)
    assert worker.is_alive(), "two wait, and the next one is not taken"
    for frame in frames:
        frame.may.set()
    worker.join(PATIENCE)
    assert [sent.get(timeout=PATIENCE).number for _ in frames] == [0, 1, 2, 3, 4]


def test_a_refusal_is_an_answer(encoder: Encoder, sent: queue.SimpleQueue[Answer]) -> None:
    frame = Slow(LinearFormat.HDR)
    frame.may.set()
    encoder.put(1, pending(frame))
    refusal = sent.get(timeout=PATIENCE).value
    assert isinstance(refusal, Refusal)
    assert (refusal.kind, refusal.location) == (RefusalKind.INVALID, ("format",))
