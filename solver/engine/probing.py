"""Light meters: irradiance at points, whoever finds the light of the scene."""

from __future__ import annotations

import numpy as np

from solver.engine.fine import FineLight
from solver.engine.sampled import SampledSolver
from solver.engine.solution import Solution
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.illumination.settings import LightSettings
from solver.types import FloatArray, Points


def light_at(
    solution: Solution,
    fine: FineLight | None,
    settings: LightSettings,
    positions: Points,
    normals: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Irradiance (n, 3) W/m2 at points (n, 3) with unit normals (n, 3), and its relative error (n,).

    The exact gather from the solution as it stands, corrected once it is; of a sampled solution, paths.
    """
    solver = solution.solver
    if isinstance(solver, SampledSolver):
        return solver.irradiance_at(positions, normals)
    point = None if fine is None else fine.prepare()
    error = solution.error_estimate if fine is None or point is None else fine.gather_error
    if point is None:
        point = PointIrradiance.of(solver.state, solver.hierarchy, settings.point_accuracy)
    found = np.broadcast_to(point.anywhere(positions, normals), (len(positions), 3))
    return found, np.where(found.any(axis=1), min(1.0, error), 0.0)
