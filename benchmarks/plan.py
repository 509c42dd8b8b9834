"""A measurement as the run sees it: jobs, each for a process of its own, and the table of what they tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from benchmarks.tables import Table

SCENES: Final = ("cornell", "office", "cube_room", "robot_cell")


@dataclass(frozen=True)
class Options:
    """What is measured."""

    scenes: tuple[str, ...] = SCENES
    quick: bool = False
    """Fewer repetitions and samples: coarser figures, and the scene that takes long left out."""


@dataclass(frozen=True)
class Job:
    """A call of a function of a module that returns a dataclass of figures."""

    label: str
    measure: Callable[..., Any]
    arguments: tuple[object, ...] = field(default=())


@dataclass(frozen=True)
class Section:
    """A measurement: what its jobs return, in their order, makes its table."""

    name: str
    jobs: tuple[Job, ...]
    table: Callable[[list[Any]], Table]
    plot: Callable[[list[Any], Path], None] | None = None
    """Draws what they return into files of a directory"""
