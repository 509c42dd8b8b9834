"""What the service counts of itself, in Prometheus's text format."""

from __future__ import annotations

import time

from prometheus_client import (
    CONTENT_TYPE_LATEST,
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
    generate_latest,
)
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_SECONDS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


class Metrics:
    """The counters of one app."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        self.sessions = Gauge("halflight_sessions", "Sessions held", registry=self._registry)
        self.warm_workers = Gauge("halflight_warm_workers", "Workers in stock", registry=self._registry)
        self.sessions_opened = Counter("halflight_sessions_opened", "Sessions made", registry=self._registry)
        self.workers_lost = Counter(
            "halflight_workers_lost", "Workers that ended unexpectedly", registry=self._registry
        )
        self.edits = Counter("halflight_edits", "Edits applied", ["op"], registry=self._registry)
        self.frames = Histogram(
            "halflight_frame_draw_seconds",
            "Time to draw a frame, without encoding",
            ["renderer"],
            buckets=_SECONDS,
            registry=self._registry,
        )
        self.stream_clients = Gauge(
            "halflight_stream_clients", "Connections of streams", registry=self._registry
        )
        self.stream_frames = Counter(
            "halflight_stream_frames", "Frames sent on streams", ["quality"], registry=self._registry
        )
        self.stream_bytes = Counter(
            "halflight_stream_bytes", "Bytes of frames sent on streams", registry=self._registry
        )
        self.stream_latency = Histogram(
            "halflight_stream_latency_seconds",
            "From a camera or an edit until the frame that shows it is handed to the connection",
            ["quality"],
            buckets=_SECONDS,
            registry=self._registry,
        )
        self.stream_round_trips = Histogram(
            "halflight_stream_round_trip_seconds",
            "From a frame until its acknowledgement",
            buckets=_SECONDS,
            registry=self._registry,
        )
        self.requests = Histogram(
            "halflight_request_seconds",
            "Time to answer a request",
            ["method", "route", "status"],
            buckets=_SECONDS,
            registry=self._registry,
        )

    @property
    def registry(self) -> CollectorRegistry:
        """What others count is told with these."""
        return self._registry

    @property
    def content_type(self) -> str:
        """The media type of `text`."""
        return CONTENT_TYPE_LATEST

    def text(self) -> bytes:
        """All counters, as Prometheus reads them."""
        return generate_latest(self._registry)


class RequestMetrics:
    """Times requests by their route's template, so that ids make no series of their own."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and time it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        start = time.perf_counter()
        status = 500

        async def observed(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self._app(scope, receive, observed)
        finally:
            route = getattr(scope.get("route"), "path", "none")
            seconds = time.perf_counter() - start
            self._metrics.requests.labels(_method(scope), route, str(status)).observe(seconds)


def _method(scope: Scope) -> str:
    known = {"GET", "POST", "PATCH", "DELETE", "HEAD", "OPTIONS", "PUT"}
    return scope["method"] if scope["method"] in known else "other"
