"""Discontinuities of irradiance: all that were found, or those that are meshed ([H B.4.4])."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np

from solver.engine.overlays.base import (
    FIRST_PAGE,
    Needs,
    Overlay,
    Page,
    Shown,
    Subject,
    Work,
    or_none,
    still_missing,
)
from solver.engine.overlays.shapes import VIOLET, Primitives, Shapes
from solver.illumination.discontinuity.discontinuities import KINDS


class Activity(StrEnum):
    """Which discontinuities are shown."""

    TRUE = "true"
    """Those that the triangulation has edges along"""
    FALSE = "false"
    ALL = "all"


@dataclass(frozen=True)
class DiscontinuitiesOverlay(Overlay):
    """Discontinuities, each with what causes it and what it weighs."""

    name: ClassVar[str] = "discontinuities"
    needs: ClassVar[Needs] = Needs.LINES
    active: Activity = Activity.ALL
    page: Page = FIRST_PAGE

    def show(self, subject: Subject) -> Work:
        """One item a discontinuity. Raises NotReadyError."""
        yield
        lines = None if subject.fine is None else subject.fine.lines
        if lines is None:
            raise still_missing(self.needs)
        surfaces, is_active = subject.world.surfaces, lines.activation.active
        wanted = {Activity.TRUE: is_active, Activity.FALSE: ~is_active}.get(self.active)
        ids = np.arange(len(is_active), dtype=np.int32) if wanted is None else np.flatnonzero(wanted)
        shown = self.page.of(ids.astype(np.int32))
        d = lines.discontinuities.take(shown)
        # An index of -1 is nothing, and has no object.
        of_patch = np.append(surfaces.object, np.int32(-1))
        statistics = lines.activation.statistics
        return Shown(
            name=self.name,
            revision=subject.revision,
            total=len(ids),
            facts={
                "objects": surfaces.object_ids,
                "counts": {
                    "found": statistics.found,
                    "active": statistics.active,
                    "dropped_by_weight": statistics.dropped_by_weight,
                    "dropped_by_limit": statistics.dropped_by_limit,
                },
            },
            columns={
                "discontinuity": shown,
                "kind": [KINDS[kind] for kind in d.kind.tolist()],
                "ends": d.ends,
                "receiver": d.receiver,
                "source": or_none(d.source),
                "blocker": or_none(d.blocker),
                "receiver_object": surfaces.object[d.receiver],
                "source_object": or_none(of_patch[d.source]),
                "blocker_object": or_none(of_patch[d.blocker]),
                "set": lines.sets.member[shown],
                "jump": d.jump,
                "weight": lines.weight[shown],
                "hardt_weight": lines.hardt_weight[shown],
                "active": is_active[shown],
            },
            shapes=Shapes(lines=Primitives.of(d.ends, VIOLET)),
        )
