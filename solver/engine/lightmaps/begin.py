"""Which bake a request begins, and what it waits for."""

from __future__ import annotations

from solver.engine.fine import FineLight
from solver.engine.lightmaps.bake import Bake, LightmapRequest, LightmapSource
from solver.engine.lightmaps.by_lights import LightsBake
from solver.engine.lightmaps.by_solution import SolutionBake
from solver.engine.overlays.base import NotReadyError
from solver.engine.solution import Solution
from solver.engine.status import SessionState
from solver.illumination.settings import Compensation, LightSettings


def begin_bake(
    request: LightmapRequest,
    revision: int,
    solution: Solution,
    fine: FineLight | None,
    settings: LightSettings,
) -> Bake | None:
    """A bake of the solution's world; None while the solution that it takes light from is worked on.

    What is missing is seen to from now on. Raises NotReadyError where it never will be there.
    """
    world = solution.world
    if request.source is LightmapSource.VPL:
        surfaces = world.surfaces
        # A solution has diffuse light alone.
        is_diffuse = not (surfaces.has_specular or surfaces.has_directional_emission)
        uses_solution = is_diffuse and settings.vpl_compensation is Compensation.SOLUTION
        point = fine.prepare() if fine is not None and uses_solution else None
        return LightsBake(world, revision, request, settings, None if point is None else point.at_patches)
    if solution.state is SessionState.FAILED:
        raise NotReadyError("the solve has ended with an error, which the session's warnings tell")
    if solution.is_sampled:
        raise NotReadyError("scenes too large to link have no solution to bake: source=vpl bakes them")
    if fine is None:
        return None
    if fine.failure is not None and fine.point_irradiance is None:
        raise NotReadyError(fine.failure)
    point = fine.prepare()
    if point is None:
        return None
    errors = solution.error_estimate, fine.gather_error
    return SolutionBake(world, revision, request, point, errors, settings.error_tolerance)
