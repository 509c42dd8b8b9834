"""Light meters: irradiance at points, whoever finds the light of the scene."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from solver.engine.fine import FineLight
from solver.engine.sampled import SampledSolver
from solver.engine.seen import darkness
from solver.engine.solution import Solution
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.illumination.settings import LightSettings
from solver.types import LUMINANCE_WEIGHTS, FloatArray, Points

_AT_POINTS: Final = 0.75
"""Error at a point of middling brightness, relative to that over what a camera sees: most err less, and
a few err more."""


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
    error = solution.error_estimate if fine is None or point is None else _AT_POINTS * fine.gather_error
    if point is None:
        point = PointIrradiance.of(solver.state, solver.hierarchy, settings.point_accuracy)
    found = np.broadcast_to(point.anywhere(positions, normals), (len(positions), 3))
    field = solution.field()
    square = (field.irradiance @ LUMINANCE_WEIGHTS) ** 2
    usual = math.sqrt(float(field.area @ square) / max(float(field.area.sum()), 1e-300))
    light = found @ LUMINANCE_WEIGHTS
    lit = light > 0.0
    told = np.zeros(len(positions))
    told[lit] = np.minimum(1.0, error * darkness(light[lit] / max(usual, 1e-300)))
    return found, told
