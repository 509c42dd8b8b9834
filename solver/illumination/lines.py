"""The lines along which the triangulation has edges, found for a solution: pending activation."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

from solver.illumination.cells import ConstraintEdges
from solver.illumination.settings import LightSettings
from solver.transport.field import RadiosityField
from solver.transport.state import TransportState
from solver.visibility.bvh import Hierarchy


@dataclass(frozen=True)
class LineStatistics:
    """Counts of discontinuities."""

    found: int
    active: int
    too_weak: int
    too_many: int


@dataclass(frozen=True, eq=False)
class ActiveLines:
    """What to constrain a triangulation with."""

    edges: ConstraintEdges
    statistics: LineStatistics


def activate_lines(
    state: TransportState, hierarchy: Hierarchy, field: RadiosityField, settings: LightSettings
) -> Generator[None, None, ActiveLines]:
    """Find, weigh and activate."""
    yield
    return ActiveLines(ConstraintEdges.none(), LineStatistics(0, 0, 0, 0))
