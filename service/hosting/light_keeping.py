"""What a worker does so that its session's light outlasts it: a solution that rests is written to a file.

That goes on beside all else, in a thread, without a copy: a change makes the solution something else, so that
what is being written then is given up before.
"""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from solver.engine.checkpoint import Checkpoint
from solver.engine.checkpoint_file import (
    CheckpointError,
    StaleCheckpointError,
    read_checkpoint,
    write_checkpoint,
)
from solver.engine.checkpoint_fine import sample_count, without_interpolants
from solver.engine.engine import Engine
from solver.engine.status import SessionState

_CALM: Final = 0.5
"""Seconds that a solution must have rested: one that is edited again and again is not written each time."""

_LONG_CALM: Final = 5.0
"""Seconds without work after which it is written once more, with the interpolants that cameras wanted:
whoever walks through a scene wants others all the time."""

_AT_REST: Final = (SessionState.CONVERGED, SessionState.PAUSED)

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LightPlace:
    """Where the light of a session is kept."""

    file: Path
    most_bytes: int
    """A larger solution is not kept."""


class LightKeeper:
    """Keeps the light of one session."""

    def __init__(self, place: LightPlace | None) -> None:
        """Without a place, nothing is kept."""
        self._place = place
        self._kept = ""
        self._samples = 0
        """Of interpolants, that are kept too"""
        self._due: float | None = None
        self._wanted = threading.Event()
        self._writing = threading.Lock()

    @property
    def due(self) -> float | None:
        """When there will be something to be written, by the monotonic clock; None where there will not."""
        return self._due

    def read(self) -> Checkpoint | None:
        """What was kept, if it is still good."""
        if self._place is None:
            return None
        try:
            found = read_checkpoint(self._place.file)
        except (FileNotFoundError, StaleCheckpointError):
            return None
        except (OSError, CheckpointError) as error:
            _log.warning("the light that was kept cannot be used, and is solved anew: %s", error)
            return None
        self._kept, self._samples = found.name, sample_count(found)
        return found

    def note(self, state: SessionState) -> None:
        """The solution stands so."""
        if self._place is None or state not in _AT_REST:
            self._due = None
        elif self._due is None and not self._wanted.is_set():
            self._due = time.monotonic() + _CALM

    def has_built(self) -> None:
        """All that is looked at has been built, on a solution that may be kept already."""
        if self._place is not None and self._wanted.is_set():
            self._due = time.monotonic() + _LONG_CALM

    def give_up(self) -> None:
        """The solution is about to become another one."""
        self._due = None
        self._wanted.clear()
        self._wanted = threading.Event()

    def keep(self, engine: Engine) -> None:
        """Begin to write what is due."""
        if self._place is None or self._due is None or time.monotonic() < self._due:
            return
        self._due = None
        self._wanted.set()
        checkpoint = engine.checkpoint()
        if checkpoint is not None and checkpoint.nbytes > self._place.most_bytes:
            checkpoint = without_interpolants(checkpoint)
        if checkpoint is None or checkpoint.nbytes > self._place.most_bytes:
            return
        if checkpoint.name == self._kept and sample_count(checkpoint) <= self._samples:
            return
        work = (checkpoint, self._place.file, self._wanted)
        threading.Thread(target=self._write, args=work, name="halflight-keeper", daemon=True).start()

    def _write(self, checkpoint: Checkpoint, file: Path, wanted: threading.Event) -> None:
        with self._writing:
            try:
                file.parent.mkdir(mode=0o700, exist_ok=True)
                if write_checkpoint(checkpoint, file, wanted.is_set):
                    self._kept, self._samples = checkpoint.name, sample_count(checkpoint)
            except OSError as error:
                _log.warning("the light of a session could not be kept: %s", error)
