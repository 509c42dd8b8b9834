"""What a visualization is: a request that knows what it needs, and shows it of a session ([H B.4]).

Overlays only read. What they need beyond the solution is fine light, which is worked on where a camera
looks; `is_ready` has that work done, and tells when there is enough of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar, Final, TypeAlias

import numpy as np

from solver.engine.drawing import Drawing
from solver.engine.fine import FineLight
from solver.engine.overlays.shapes import Shapes
from solver.engine.requests import CameraChoice
from solver.engine.solution import Solution
from solver.engine.status import SessionState
from solver.engine.world import World
from solver.errors import SceneError, SolverError
from solver.geometry.scene import Camera
from solver.illumination.interpolation.interpolants import Interpolants
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.types import AnyArray, IntArray, Spectra

DEFAULT_LIMIT: Final = 20_000
"""Items that an overlay shows, unless asked for more or fewer."""

MAX_LIMIT: Final = 200_000
"""Items that one overlay shows at most."""

Column: TypeAlias = AnyArray | Sequence[object]
"""One value an item."""

Work: TypeAlias = "Generator[None, None, Shown]"
"""An overlay in the making; yields every few milliseconds."""


class NotReadyError(SolverError):
    """What an overlay shows is not there yet, or never will be."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


class Needs(Enum):
    """What must be there before an overlay can be shown."""

    SOLUTION = "the solution as it stands"
    POINT = "point irradiance by the settled solution"
    LINES = "the discontinuities of the settled solution"
    TRIANGLES = "the triangulation of the settled solution"


@dataclass(frozen=True, eq=False)
class Subject:
    """What overlays look at: a session at one moment."""

    revision: int
    world: World
    solution: Solution
    drawing: Drawing
    fine: FineLight | None
    """None while the solution is worked on"""
    camera: Camera
    """Whose view fine light is made for"""

    def interpolants(self) -> Interpolants:
        """The interpolants. Raises NotReadyError while there are none."""
        found = None if self.fine is None else self.fine.interpolants
        if found is None:
            raise still_missing(Needs.TRIANGLES)
        return found

    def point_irradiance(self) -> PointIrradiance:
        """Point irradiance. Raises NotReadyError while there is none."""
        found = None if self.fine is None else self.fine.point_irradiance
        if found is None:
            raise still_missing(Needs.POINT)
        return found


@dataclass(frozen=True)
class Page:
    """Which of many items are shown."""

    limit: int = DEFAULT_LIMIT
    offset: int = 0

    def of(self, ids: IntArray) -> IntArray:
        """Those of `ids` (n,) that are shown."""
        return ids[self.offset : self.offset + self.limit]


FIRST_PAGE: Final = Page()


@dataclass(frozen=True, eq=False)
class Shown:
    """A visualization: `columns` hold one value for each item, in the same order."""

    name: str
    revision: int
    total: int
    """Items that there are, shown or not"""
    facts: Mapping[str, object]
    """What is true of all items"""
    columns: Mapping[str, Column]
    shapes: Shapes


class Overlay(ABC):
    """A visualization that is asked for."""

    name: ClassVar[str]
    needs: ClassVar[Needs] = Needs.SOLUTION

    @abstractmethod
    def show(self, subject: Subject) -> Work:
        """Show it; `subject` must be ready for it. Raises SceneError naming a parameter, NotReadyError."""

    def is_built(self, subject: Subject) -> bool:
        """Whether the triangles that it shows are built; asks for those that are not. Raises SceneError."""
        return subject.fine is not None


@dataclass(frozen=True)
class OverlayRequest:
    """An overlay, as seen by whom, and when."""

    overlay: Overlay
    camera: CameraChoice
    complete: bool = False
    """Wait until the solution rests, and all is built that the camera sees."""


def is_ready(overlay: Overlay, subject: Subject, complete: bool) -> bool:
    """Whether `overlay` can be shown, and `complete`; what is missing is worked on from now on.

    Raises NotReadyError where it never can, RenderingUnavailableError, SceneError.
    """
    state, fine = subject.solution.state, subject.fine
    if overlay.needs is Needs.SOLUTION:
        return not complete or state is not SessionState.SOLVING
    if state is SessionState.FAILED:
        raise NotReadyError("the solve has ended with an error, which the session's warnings tell")
    if subject.solution.is_sampled:
        raise NotReadyError(
            f"it needs {overlay.needs.value}, which scenes too large to link do not have: see the warnings"
        )
    if fine is None:
        return False
    if overlay.needs is Needs.POINT:
        return fine.prepare() is not None
    subject.drawing.require_device()
    fine.ask(subject.camera)
    if complete and not fine.is_complete(subject.camera):
        return False
    if overlay.needs is Needs.LINES:
        return fine.lines is not None
    return fine.interpolants is not None and overlay.is_built(subject)


def still_missing(needs: Needs) -> NotReadyError:
    """That what an overlay needs is not there yet."""
    return NotReadyError(f"it needs {needs.value}, which is being worked on: wait longer, or ask again")


def index_of(value: int, count: int, name: str, what: str) -> int:
    """`value`, which must be one of `count` things called `what`. Raises SceneError naming `name`."""
    if not 0 <= value < count:
        there = f"there are {what} 0 to {count - 1}" if count else f"there are no {what}"
        raise SceneError(there, (name,))
    return value


def or_none(numbers: IntArray) -> list[object]:
    """Numbers of any shape as lists, None for those below 0."""
    told = numbers.astype(object)
    told[numbers < 0] = None
    found: list[object] = told.tolist()
    return found


def to_rgb(spectra: Spectra) -> Spectra:
    """(n, 3) of (n, 1 or 3)."""
    return np.repeat(spectra, 3, axis=1) if spectra.shape[1] == 1 else spectra
