"""What the service counts of its sessions' lives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from prometheus_client import CollectorRegistry, Gauge, Histogram

_SECONDS: Final = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)


class SessionMetrics:
    """The counters of one app's sessions."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self._by_state = Gauge(
            "halflight_sessions_by_state", "Sessions kept, by state", ["state"], registry=registry
        )
        self.changes = Histogram(
            "halflight_change_seconds",
            "From an edit, undo, redo or change of settings until it is applied and written",
            ["step"],
            buckets=_SECONDS,
            registry=registry,
        )
        self.frames = Histogram(
            "halflight_frame_seconds",
            "From asking for a frame until it is there, encoded; those that wait for light are left out",
            ["renderer"],
            buckets=_SECONDS,
            registry=registry,
        )
        self.commits = Histogram(
            "halflight_journal_commit_seconds",
            "Time to make a transaction of the journal safe",
            buckets=_SECONDS,
            registry=registry,
        )
        self.wakings = Histogram(
            "halflight_wake_seconds",
            "Time to bring back a session that slept or whose process was lost",
            buckets=_SECONDS,
            registry=registry,
        )

    def follow(self, count: Callable[[], dict[str, int]]) -> None:
        """Tell what `count` says whenever it is asked for: sessions by state, always of the same states."""
        for state in count():
            self._by_state.labels(state).set_function(lambda state=state: count()[state])  # type: ignore[misc]
