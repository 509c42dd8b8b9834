"""The service's settings, from the environment: `HALFLIGHT_<NAME>`, and `HOST` and `PORT`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, TypeAlias

from pydantic import AliasChoices, Field, SecretStr
from pydantic_settings import BaseSettings, SettingsConfigDict

from service.hosting.lasting import Terms
from service.hosting.sessions import Quotas
from service.logs import LogStyle
from solver.document.limits import SceneLimits
from solver.engine.requests import FrameLimits
from solver.errors import LimitExceededError
from solver.illumination.settings import LightSettings
from solver.parallel import core_count

_Count: TypeAlias = Annotated[int, Field(ge=1)]


class ServiceSettings(BaseSettings):
    """How the service runs, and what it puts up with."""

    model_config = SettingsConfigDict(env_prefix="HALFLIGHT_", frozen=True)

    host: str = Field(
        default="127.0.0.1",
        min_length=1,
        validation_alias=AliasChoices("HALFLIGHT_HOST", "HOST", "host"),
        description="Address to listen on. Only this machine reaches the default.",
    )
    port: int = Field(
        default=8000,
        ge=0,
        le=65535,
        validation_alias=AliasChoices("HALFLIGHT_PORT", "PORT", "port"),
        description="Port to listen on; 0 takes a free one.",
    )
    token: SecretStr | None = Field(
        default=None,
        min_length=1,
        description="Where given, /v1 and /metrics ask for it as a bearer token. It opens all sessions.",
    )
    tokens: SecretStr | None = Field(
        default=None,
        min_length=1,
        description="More bearer tokens, by comma. Each opens the sessions alone that it has made.",
    )
    data_dir: Path | None = Field(
        default=None,
        description="Directory in which sessions are kept, so that they outlast the service. No two services "
        "may share one. Without, they outlast their workers alone.",
    )
    log: LogStyle = Field(
        default=LogStyle.QUIET,
        description="What is logged: `quiet`, warnings alone; `text` or `json`, each request too.",
    )
    pool_size: int = Field(default=2, ge=0, le=64, description="Workers kept ready for the next sessions.")
    idle_seconds: float = Field(
        default=1800.0,
        gt=0.0,
        description="A session that nobody has used for this long is put to sleep: its process is ended, and "
        "the next request wakes it.",
    )
    expire_seconds: float = Field(
        default=604_800.0, gt=0.0, description="A session that nobody has used for this long is deleted."
    )
    wake_seconds: float = Field(
        default=30.0, gt=0.0, description="Longest wait for a session that is being brought back."
    )
    max_sessions: _Count = Field(default=16, description="Sessions awake at once.")
    max_working: int = Field(
        default=0,
        ge=0,
        description="Sessions that work on their light at once, in turns; 0: as many as there are cores.",
    )
    max_session_bytes: int = Field(
        default=4 * 2**30,
        ge=2**20,
        description="Bytes of memory that a session may take; one that takes more is paused, with a warning.",
    )
    max_kept_sessions: _Count = Field(default=1000, description="Sessions in all, sleeping ones too.")
    max_light_bytes: int = Field(
        default=256 * 2**20,
        ge=0,
        description="Bytes of the solution of a session that are kept in the data directory, so that it need "
        "not be solved anew; 0: none.",
    )
    max_kept_light_bytes: int = Field(
        default=4 * 2**30, ge=0, description="Bytes of all solutions that are kept; the newest are."
    )
    max_body_bytes: _Count = Field(default=32 * 2**20, description="Bytes of a request body.")
    max_message_bytes: _Count = Field(default=4 * 2**20, description="Bytes of a message on a stream.")
    head_seconds: float = Field(
        default=10.0, gt=0.0, description="Longest that the head of a request may take to come."
    )
    body_seconds: float = Field(
        default=20.0, gt=0.0, description="Longest that a body may take, beside its time at body_rate."
    )
    body_rate: float = Field(default=16384.0, gt=0.0, description="Least bytes of a body in a second.")
    max_session_streams: _Count = Field(
        default=32, description="Streams of a session at once, WebSockets and events."
    )
    max_streams: _Count = Field(default=256, description="Streams in all at once.")
    stream_idle_seconds: float = Field(
        default=120.0, gt=0.0, description="A stream on which nothing has come for this long is closed."
    )
    max_polygons: _Count = Field(default=20_000, description="Faces of a scene.")
    max_vertices: _Count = Field(default=200_000, description="Vertices, or corners of faces, of a scene.")
    max_elements: _Count = Field(
        default=2_000_000, description="Largest `max_elements` that a client may set."
    )
    max_links: _Count = Field(default=30_000_000, description="Largest `max_links` that a client may set.")
    max_frame_width: _Count = Field(default=4096, description="Pixels across a frame.")
    max_frame_height: _Count = Field(default=4096, description="Pixels down a frame.")
    max_frame_pixels: _Count = Field(default=2**23, description="Pixels of a frame.")
    max_samples: _Count = Field(default=64, description="Samples of a pixel.")
    max_probe_points: _Count = Field(default=10_000, description="Points of a probe.")
    max_edits: _Count = Field(default=1000, description="Edits in a batch.")
    max_wait_ms: _Count = Field(default=600_000, description="Longest wait for a frame, whatever is asked.")

    @property
    def places(self) -> int:
        """Sessions that work on their light at once."""
        return self.max_working or core_count()

    @property
    def quotas(self) -> Quotas:
        """How many sessions may be, and how long."""
        return Quotas(self.max_sessions, self.max_kept_sessions, self.idle_seconds, self.expire_seconds)

    @property
    def terms(self) -> Terms:
        """What holds for all sessions."""
        return Terms(self.scene_limits, self.frame_limits, self.max_session_bytes, self.wake_seconds)

    @property
    def scene_limits(self) -> SceneLimits:
        """The largest scene."""
        return SceneLimits(self.max_polygons, self.max_vertices)

    @property
    def frame_limits(self) -> FrameLimits:
        """The largest frame."""
        return FrameLimits(
            self.max_frame_width, self.max_frame_height, self.max_frame_pixels, self.max_samples
        )

    @property
    def solver_defaults(self) -> LightSettings:
        """Solver settings of a session that gives none, within the limits."""
        defaults = LightSettings()
        return replace(
            defaults,
            max_elements=min(defaults.max_elements, self.max_elements),
            max_links=min(defaults.max_links, self.max_links),
        )

    def check_solver(self, settings: LightSettings) -> None:
        """Raise LimitExceededError where a client's solver settings ask for too much."""
        if settings.max_elements > self.max_elements:
            raise LimitExceededError("max_elements", settings.max_elements, self.max_elements)
        if settings.max_links > self.max_links:
            raise LimitExceededError("max_links", settings.max_links, self.max_links)
