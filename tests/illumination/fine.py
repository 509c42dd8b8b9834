"""Settled solutions with triangulations over them."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

import numpy as np

from solver.illumination.interpolation.interpolants import Interpolants
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.triangulation import Triangulation, triangulate
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.transport.solve import RadiositySolver
from solver.types import FloatArray

T = TypeVar("T")


def drain(work: Generator[object, None, T]) -> T:
    """What a generator returns in the end."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]


def triangulated(solver: RadiositySolver, edges: ConstraintEdges | None = None) -> Triangulation:
    """The leaves of a solution in triangles."""
    cells = Cells.of(solver.field())
    return triangulate(cells, solver.surfaces, edges or ConstraintEdges.none(), None)


def edge(patch: int, start: list[float], end: list[float], jump: bool) -> ConstraintEdges:
    """One edge."""
    return ConstraintEdges(
        np.array([patch], dtype=np.int32),
        np.array([[start, end]]),
        np.zeros(1, dtype=np.int32),
        np.array([jump]),
    )


def interpolants_of(
    solver: RadiositySolver, edges: ConstraintEdges | None = None, before: Interpolants | None = None
) -> Interpolants:
    """Interpolants over the leaves of a solution, none built yet."""
    point = PointIrradiance.of(solver.state, solver.hierarchy)
    field = solver.field()
    mesh = triangulated(solver, edges)
    return Interpolants(point, solver.state.tree.leaves, Cells.of(field), mesh, field.irradiance, before)


def build_all(interpolants: Interpolants) -> Interpolants:
    """The same, with every triangle built and checked."""
    interpolants.want(np.ones(len(interpolants.triangulation.triangles)))
    while interpolants.step():
        pass
    return interpolants


def relative_error(interpolants: Interpolants) -> float:
    """What the checks tell: RMS luminance error over RMS luminance irradiance."""
    area: FloatArray = interpolants.area
    error, light = interpolants.errors(), interpolants.mean_luminance()
    return float(np.sqrt((area * error**2).sum() / (area * light**2).sum()))
