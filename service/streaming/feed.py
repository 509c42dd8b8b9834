"""The frames that one client is sent: the newest view first, better ones while it rests.

A frame is asked of the worker only when the client can take one: at most two are unacknowledged. So nothing
queues up, whatever the client's connection is like, and a camera that was replaced before its turn came is
never drawn. Frames are drawn and encoded by the session's worker, like any other.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from dataclasses import dataclass, replace
from typing import Final

from service.hosting.messages import FrameAnswer, GetFrame
from service.hosting.pictures import Presentation
from service.hosting.remote import RefusedError
from service.hosting.sessions import Session
from service.metrics import Metrics
from service.negotiation import MEDIA_TYPES
from service.problems import INVALID, ProblemError
from service.streaming.incoming import SOURCE, CameraMessage
from service.streaming.outgoing import ErrorMessage, FrameHeader, Outbox
from service.streaming.pacing import LADDER, Pace, Quality
from solver.engine.requests import RendererName, Wait, WaitFor

MOST_UNACKNOWLEDGED: Final = 2
"""Frames on their way to a client"""

_NOTICEABLE: Final = 0.7
"""At rest, a frame is sent again when its error estimate is below this part of what it was,"""

_LOOK_AGAIN: Final = 1.0
"""or after so many seconds, if it is another picture by then."""

_MOVING_WAIT: Final = 0.3
"""Seconds that a moving view waits for something to show"""

_PATIENCE: Final = 30.0
"""Seconds after which an unanswered request for a frame is put again"""

_NOW: Final = Wait()

_PREVIEW: Final = 3.0
"""Seconds that a coarse frame may take which is shown before a full one"""

_SLOW: Final = (RendererName.PATH, RendererName.GATHER)
"""What takes seconds for a full frame, and has a coarse one before"""

_NOT_YET: Final = (RendererName.PATH, RendererName.VPL, RendererName.GATHER)
"""What has nothing to show before every pixel has light; others show the solution as it stands."""


@dataclass(frozen=True)
class _Ask:
    """A frame that is wanted."""

    view: int
    quality: Quality
    wait: Wait = _NOW
    timeout: float = _PATIENCE
    since: float | None = None
    """When it became wanted; None where it is but a better one of what is shown"""


@dataclass(frozen=True)
class _Shown:
    """What the client was shown last."""

    view: int
    quality: Quality
    answer: FrameAnswer
    is_there: bool
    """Whether it was sent, or the client had it"""
    standing: object
    """How the session stood when it was asked for"""


@dataclass(frozen=True)
class _Sent:
    """A frame that is not acknowledged yet."""

    number: int
    at: float
    quality: Quality
    took: float
    """Seconds in the worker"""


class Feed:
    """Chooses, fetches and sends the frames of one client."""

    def __init__(self, session: Session, outbox: Outbox, metrics: Metrics) -> None:
        self._worker = session.worker
        self._outbox = outbox
        self._metrics = metrics
        self._pace = Pace()
        self._stir = asyncio.Event()
        self._camera: CameraMessage | None = None
        self._view = 0
        self._revision = 0 if session.worker.status is None else session.worker.status.revision
        self._changed_at = time.monotonic()
        self._shown: _Shown | None = None
        self._number = 0
        self._unacknowledged: deque[_Sent] = deque()

    def look(self, camera: CameraMessage) -> None:
        """Show this from now on."""
        self._camera = camera
        self._view += 1
        self._changed()

    def acknowledge(self, number: int) -> None:
        """The frame of that number has arrived, and all before it. Raises ProblemError."""
        if number > self._number:
            raise ProblemError.of_field(INVALID, [SOURCE, "number"], "no frame of that number was sent")
        now = time.monotonic()
        while self._unacknowledged and self._unacknowledged[0].number <= number:
            sent = self._unacknowledged.popleft()
            self._metrics.stream_round_trips.observe(now - sent.at)
            if sent.quality is Quality.MOVING:
                self._pace.took(sent.took + now - sent.at)
        self._stir.set()

    async def run(self) -> None:
        """Send frames until the session ends. Raises WorkerGoneError, WebSocketDisconnect."""
        news = asyncio.create_task(self._heed_news())
        try:
            while not self._worker.gone:
                self._stir.clear()
                ask = self._next()
                if ask is None:
                    await self._stirred(self._pace.until_rest(time.monotonic()))
                else:
                    await self._show(ask)
        finally:
            news.cancel()
            await asyncio.wait([news])

    def _changed(self) -> None:
        self._changed_at = time.monotonic()
        self._pace.touch(self._changed_at)
        self._stir.set()

    async def _heed_news(self) -> None:
        while not self._worker.gone:
            status = self._worker.status
            if status is not None and status.revision != self._revision:
                self._revision = status.revision
                self._changed()
            self._stir.set()
            await self._worker.news()
        self._stir.set()

    async def _stirred(self, timeout: float | None) -> None:
        try:
            async with asyncio.timeout(timeout):
                await self._stir.wait()
        except TimeoutError:
            pass

    def _next(self) -> _Ask | None:
        """What to ask for now; None where there is nothing, or no room for it."""
        if self._camera is None or len(self._unacknowledged) >= MOST_UNACKNOWLEDGED:
            return None
        shown, since = self._shown, self._changed_at
        is_new = shown is None or (shown.view, shown.answer.outlook.revision) != (self._view, self._revision)
        if self._pace.is_moving(time.monotonic()):
            return _Ask(self._view, Quality.MOVING, _NOW, _MOVING_WAIT, since) if is_new else None
        if shown is None or is_new:
            if self._camera.renderer in _SLOW:
                return _Ask(self._view, Quality.MOVING, _NOW, _PREVIEW, since)
            return _Ask(self._view, Quality.REST, since=since)
        if shown.quality is Quality.MOVING:
            return _Ask(self._view, Quality.REST)
        if shown.answer.outlook.improving:
            better = Wait(WaitFor.MAX_ERROR, _NOTICEABLE * shown.answer.outlook.error_estimate)
            return _Ask(self._view, Quality.REST, better, _LOOK_AGAIN)
        if shown.standing != self._standing():
            return _Ask(self._view, Quality.REST)
        return None

    def _standing(self) -> object:
        """What of the session's status a view that is complete depends on."""
        status = self._worker.status
        return None if status is None else (status.state, status.revision, status.settings)

    async def _show(self, ask: _Ask) -> None:
        camera = self._camera
        if camera is None:
            return
        revision, standing, start = self._revision, self._standing(), time.monotonic()
        try:
            answer = await self._fetch(self._request(camera, ask), ask, revision)
        except RefusedError as error:
            if ask.view == self._view:
                self._camera = None  # until the client asks for something else
            told = ProblemError.of_refusal(error.refusal, SOURCE).problem
            await self._outbox.tell(ErrorMessage(id=camera.id, problem=told))
            return
        if answer is None:
            return
        shown, is_good = self._shown, answer.outlook.converged
        if answer.content is None and shown is not None and is_good > shown.answer.outlook.converged:
            # The same picture, and now it is known to be good: it is sent once more, to say so.
            self._shown = replace(shown, is_there=False)
            return
        is_worth = answer.outlook.drawable or answer.outlook.renderer not in _NOT_YET
        self._shown = _Shown(ask.view, ask.quality, answer, is_worth, standing)
        if ask.quality is Quality.MOVING and not is_worth:
            self._pace.took(ask.timeout)
        if answer.content is not None and is_worth:
            await self._send(camera, ask, answer, answer.content, time.monotonic() - start)

    def _request(self, camera: CameraMessage, ask: _Ask) -> GetFrame:
        frame = camera.frame
        presentation = Presentation(scale_maximum=camera.lux)
        if ask.quality is Quality.MOVING:
            coarse = LADDER[-1] if frame.renderer is RendererName.PATH else self._pace.coarseness
            presentation = replace(presentation, scale=coarse.scale, quality=coarse.quality)
            if frame.renderer is RendererName.GATHER:
                frame = replace(frame, renderer=RendererName.INTERPOLANT)
        shown = self._shown
        known = {shown.answer.tag} if shown is not None and shown.is_there else set()
        return GetFrame(frame, camera.encoding, ask.wait, ask.timeout, frozenset(known), presentation)

    async def _fetch(self, request: GetFrame, ask: _Ask, revision: int) -> FrameAnswer | None:
        """The answer; None where the view changed before it came, and it might take long."""
        fetching = asyncio.create_task(self._worker.call(request))
        try:
            while True:
                stirred = asyncio.create_task(self._stir.wait())
                await asyncio.wait({fetching, stirred}, return_when=asyncio.FIRST_COMPLETED)
                stirred.cancel()
                if fetching.done():
                    return fetching.result()
                self._stir.clear()
                is_stale = (self._view, self._revision) != (ask.view, revision)
                if is_stale and ask.timeout > _MOVING_WAIT:
                    return None
        finally:
            fetching.cancel()
            await asyncio.wait([fetching])
            if not fetching.cancelled():
                fetching.exception()  # whoever is left to hear of it, it is not the log

    async def _send(
        self, camera: CameraMessage, ask: _Ask, answer: FrameAnswer, content: bytes, took: float
    ) -> None:
        self._number += 1
        self._unacknowledged.append(_Sent(self._number, time.monotonic(), ask.quality, took))
        header = FrameHeader(
            number=self._number,
            id=camera.id,
            revision=answer.outlook.revision,
            error_estimate=answer.outlook.error_estimate,
            converged=answer.outlook.converged,
            renderer=answer.outlook.renderer,
            layer=camera.layer,
            media_type=MEDIA_TYPES[camera.format],
            width=answer.width,
            height=answer.height,
            quality=ask.quality,
            bytes=len(content),
            render_ms=round(1000.0 * answer.seconds, 3),
            scale_maximum=answer.scale_maximum,
        )
        await self._outbox.show(header, content)
        self._metrics.frames.labels(answer.outlook.renderer).observe(answer.seconds)
        self._metrics.stream_frames.labels(ask.quality).inc()
        self._metrics.stream_bytes.inc(len(content))
        if ask.since is not None:
            self._metrics.stream_latency.labels(ask.quality).observe(time.monotonic() - ask.since)
