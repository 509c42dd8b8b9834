"""What is kept of a measurement: frames of one renderer by one setting, each with its time and its error."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Self


class Case(StrEnum):
    """Where a clock starts."""

    COLD = "cold"
    """At a scene that nothing is known of, as text"""
    EDITED = "edited"
    """At a small edit of a scene whose frame is finished"""


class Ending(StrEnum):
    """Why a trial has no more frames."""

    COMPLETE = "complete"
    """What was asked for is reached"""
    TIME = "time"
    """It took longer than a measurement may"""
    UNABLE = "unable"
    """It could not be made"""


@dataclass(frozen=True)
class Shot:
    """A frame that could have been had."""

    seconds: float
    """Of wall time from the clock's start to the frame, the drawing of this one included and no other"""
    error: float
    """Relative RMS luminance error"""


@dataclass(frozen=True)
class Trial:
    """Frames of one view, one renderer and one setting, in the order of time."""

    scene: str
    case: Case
    renderer: str
    setting: str
    shots: tuple[Shot, ...]
    ending: Ending
    peak_memory: float
    """MB"""
    note: str = ""
    is_peer: bool = False

    @classmethod
    def from_record(cls, record: dict[str, Any]) -> Self:
        """Of what `asdict` made."""
        shots = tuple(Shot(**shot) for shot in record["shots"])
        known = {**record, "shots": shots, "case": Case(record["case"]), "ending": Ending(record["ending"])}
        return cls(**known)


@dataclass(frozen=True)
class Trials:
    """Of one process."""

    trials: tuple[Trial, ...]
    missing: str = ""
    """Why there are none, if so"""
