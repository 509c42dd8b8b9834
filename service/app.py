"""The application: routes, errors, limits and the life of the workers behind them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import Depends, FastAPI
from starlette.middleware import Middleware

from service import problems
from service.config import ServiceSettings
from service.context import Context, require_token
from service.hosting.board import Board
from service.hosting.nursery import Nursery
from service.hosting.pool import WorkerPool
from service.hosting.sessions import Sessions
from service.journal.journal import Journal
from service.journal.lights import Lights
from service.json_body import BodyLimit
from service.logs import RequestLog
from service.metrics import Metrics, RequestMetrics
from service.openapi import describe, version
from service.routes import (
    edits,
    events,
    exports,
    files,
    frames,
    lightmaps,
    overlays,
    pages,
    picks,
    probe,
    scenes,
    snapshots,
    stream,
)
from service.routes import sessions as session_routes
from service.session_metrics import SessionMetrics
from service.slow_clients import BodyPace
from service.streaming.quota import StreamQuota


def create_app(settings: ServiceSettings | None = None, nursery: Nursery | None = None) -> FastAPI:
    """A new application. Its workers start and end with its lifespan, and so does the nursery that they
    come from, unless one is given, which apps may share."""
    chosen = settings or ServiceSettings()
    metrics = Metrics()
    source = nursery or Nursery()
    pool = WorkerPool(source, Board(chosen.places), chosen.pool_size, metrics.workers_lost.inc)
    lives = SessionMetrics(metrics.registry)
    journal = Journal(chosen.data_dir, lives.commits.observe)
    lights = Lights(chosen.data_dir, chosen.max_light_bytes, chosen.max_kept_light_bytes)
    sessions = Sessions(pool, journal, lights, chosen.quotas, chosen.terms, lives)
    lives.follow(sessions.count_by_state)
    metrics.sessions.set_function(lambda: len(sessions))
    metrics.warm_workers.set_function(lambda: pool.stock)
    app = FastAPI(
        title="halflight",
        version=version(),
        lifespan=_life,
        middleware=[
            Middleware(RequestLog),
            Middleware(RequestMetrics, metrics=metrics),
            Middleware(BodyPace, seconds=chosen.body_seconds, rate=chosen.body_rate),
            Middleware(BodyLimit, max_bytes=chosen.max_body_bytes),
        ],
        redoc_url=None,
    )
    streams = StreamQuota(chosen.max_session_streams, chosen.max_streams)
    own = None if nursery else source
    app.state.context = Context(chosen, pool, journal, sessions, metrics, streams, own)
    problems.install(app)
    app.include_router(pages.router)
    for routes in (
        scenes, files, session_routes, edits, frames, probe, picks, overlays, lightmaps, exports, events,
        stream, snapshots,
    ):  # fmt: skip
        app.include_router(routes.router, dependencies=[Depends(require_token)])
    app.include_router(stream.sockets)
    describe(app)
    return app


@asynccontextmanager
async def _life(app: FastAPI) -> AsyncIterator[None]:
    context: Context = app.state.context
    await context.begin()
    tidying = asyncio.create_task(context.sessions.tidy_forever())
    try:
        yield
    finally:
        tidying.cancel()
        await asyncio.gather(tidying, return_exceptions=True)
        await context.end()
