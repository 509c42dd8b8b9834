"""Snapshots that come from clients: told as what a session goes on from, or what is wrong with them."""

from __future__ import annotations

from collections.abc import Sequence

from service.config import ServiceSettings
from service.journal.documents import Snapshot
from service.journal.recollection import Recollection
from service.problems import ProblemError
from solver.document.settings import SettingsDocument
from solver.engine.past import Past
from solver.errors import LimitExceededError, SceneError
from solver.illumination.settings import LightSettings


def accepted(
    snapshot: Snapshot,
    limits: ServiceSettings,
    source: Sequence[str],
    settings: SettingsDocument | None = None,
) -> tuple[Past, LightSettings]:
    """What a session of `snapshot` goes on from, with what is given of `settings` in the place of its own.

    Every edit is tried. Raises ProblemError located under `source`, LimitExceededError.
    """
    longest = max((len(batch) for batch in (*snapshot.batches, *snapshot.undone)), default=0)
    if longest > limits.max_edits:
        raise LimitExceededError("edits", longest, limits.max_edits)
    limits.scene_limits.check_document(snapshot.scene)
    chosen = snapshot.settings.changes_to(limits.solver_defaults)
    if settings is not None:
        chosen = settings.changes_to(chosen)
    limits.check_solver(chosen)
    try:
        past = Recollection(snapshot).past()
    except SceneError as error:
        raise ProblemError.of_scene(error, [*source, "scene"]) from None
    try:
        past.history(limits.scene_limits)
    except SceneError as error:
        # A batch is a list of edits, where one that is posted is an object that has them.
        location = tuple(part for part in error.location if part != "edits")
        raise ProblemError.of_scene(SceneError(error.message, location), source) from None
    return past, chosen
