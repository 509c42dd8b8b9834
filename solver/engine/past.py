"""What a session was before, as far as light does not decide it: where an engine goes on from.

All of it follows from what clients sent, so that whoever keeps that can bring back a session whose process
has ended. The light itself settles anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from solver.document.edits import Edit, apply_edits
from solver.document.limits import SceneLimits
from solver.engine.history import History, Step, step_of
from solver.engine.status import Change
from solver.errors import SceneError
from solver.geometry.scene import Scene

Batch: TypeAlias = tuple[Edit, ...]


@dataclass(frozen=True, eq=False)
class Past:
    """A scene with the edits since."""

    scene: Scene
    """Before the oldest batch"""
    batches: tuple[Batch, ...] = ()
    """Those that stand, oldest first"""
    undone: tuple[Batch, ...] = ()
    """Those that were taken back and can be brought back, the latest taken back last"""
    revision: int = 1
    entries: tuple[Change, ...] = ()
    """Of the change log, oldest first"""
    count: int = 0
    """Entries that there ever were"""
    drags: bool = False
    """Whether the last entry stands for an object that may be moved on"""
    gesture: str | None = None
    """That the newest of `batches` is part of, and what follows may be"""

    def history(self, limits: SceneLimits) -> tuple[History, Scene]:
        """The history, and the scene as it stands.

        Raises SceneError located in `scene`, `batches.<index>` or `undone.<index>`, LimitExceededError.
        """
        limits.check(self.scene)
        places = [("batches", index) for index in range(len(self.batches))]
        past, standing = _steps(self.scene, self.batches, places, limits)
        places = [("undone", index) for index in range(len(self.undone))]
        future, _ = _steps(standing, self.undone[::-1], places[::-1], limits)
        return History.of(past, future[::-1], self.gesture), standing


def _steps(
    scene: Scene, batches: Sequence[Batch], places: Sequence[tuple[str, int]], limits: SceneLimits
) -> tuple[list[tuple[Scene, Step]], Scene]:
    """The steps of `batches` from `scene` on, each with the scene before it, and the scene after all."""
    steps = []
    for batch, place in zip(batches, places, strict=True):
        try:
            after = apply_edits(scene, batch)
        except SceneError as error:
            raise SceneError(error.message, (*place, *error.location)) from None
        limits.check(after)
        steps.append((scene, step_of(batch, after)))
        scene = after
    return steps, scene
