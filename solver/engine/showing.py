"""What is shown of a session: the views of its light, and what is built for them beside the solution.

It is told of every solution that takes the place of another. Interpolants and gathers are of one solution;
virtual lights and paths go by the scene alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from solver.engine.auto import AutoView, renderers_for
from solver.engine.checkpoint import Checkpoint
from solver.engine.checkpoint_fine import interpolants_alone
from solver.engine.drawing import BEST_RENDERER, WITHOUT_LINKS, Drawing
from solver.engine.fine import FineLight
from solver.engine.followed import FollowedLight, follow
from solver.engine.gathers import GatherFrames
from solver.engine.instant.frames import InstantFrames
from solver.engine.paths import PathFrames
from solver.engine.requests import (
    CameraChoice,
    FrameLimits,
    FrameRequest,
    LayerName,
    NotAvailableError,
    RendererName,
)
from solver.engine.seen import SeenErrors
from solver.engine.solution import Solution
from solver.engine.status import FineStatistics, SessionState
from solver.engine.views import GatherView, InstantView, InterpolantView, PathView, SolutionView, View
from solver.engine.world import World
from solver.geometry.scene import Camera
from solver.illumination.particles.compensation import Known
from solver.illumination.settings import LightSettings

_MEANWHILE: Final = 2.5e-8
"""Seconds of work in the midst of a drag while a frame is drawn, a pixel and sample: software OpenGL takes at
least that long, and leaves cores idle"""


class Showing:
    """Views of one session."""

    def __init__(
        self,
        world: World,
        solution: Solution,
        settings: LightSettings,
        drawing: Drawing,
        limits: FrameLimits,
        kept: Checkpoint | None = None,
    ) -> None:
        """Of a first solution, which may have been `kept`."""
        self._drawing = drawing
        self._limits = limits
        self._settings = settings
        self._world = world
        self._solution = solution
        self._kept = None if kept is None else interpolants_alone(kept)
        self._paths = PathFrames(world)
        self._fine: FineLight | None = None
        self._gathers: GatherFrames | None = None
        self._instant: InstantFrames | None = None
        self._seen_errors = SeenErrors()
        self._followed: FollowedLight | None = None
        """The last interpolants, if what has happened to the light since then is traced"""

    # --- what it goes by ------------------------------------------------------------------------------

    def leave(self) -> FollowedLight | None:
        """What can still be shown when the solution is taken over by another; None where there is nothing."""
        return None if self._fine is None else follow(self._fine)

    def turn(
        self, world: World, solution: Solution, settings: LightSettings, left: FollowedLight | None
    ) -> None:
        """Show another solution, perhaps of another world, from now on, and meanwhile what was `left`."""
        self._followed = None if solution.trace() is None else left or self._followed
        self._world, self._solution, self._settings = world, solution, settings
        self._kept = None
        self._fine, self._gathers, self._paths = None, None, PathFrames(world)
        if self._instant is not None:
            self._instant.follow(world)

    def configure(self, settings: LightSettings) -> None:
        """Show the same solution by other settings."""
        self._settings = settings
        self._fine, self._gathers, self._instant = None, None, None

    # --- what it holds --------------------------------------------------------------------------------

    @property
    def fine(self) -> FineLight | None:
        """Fine light, as far as somebody has asked for it."""
        return self._fine

    @property
    def instant(self) -> InstantFrames | None:
        """Frames by virtual lights, as far as somebody has asked for one."""
        return self._instant

    def fine_light(self) -> FineLight | None:
        """Fine light, once the solution rests; a sampled one never has any."""
        rests = self._solution.state in (SessionState.CONVERGED, SessionState.PAUSED)
        if self._fine is None and rests and not self._solution.is_sampled:
            before = None if self._followed is None else self._followed.interpolants
            self._fine = FineLight(self._solution, self._drawing, self._settings, before, self._kept)
        return self._fine

    def statistics(self) -> FineStatistics:
        """Counts of fine light at this moment."""
        return FineStatistics() if self._fine is None else self._fine.statistics()

    def known_light(self) -> Known | None:
        """The light of the solution at points of patches, once it is corrected."""
        fine = self.fine_light()
        point = None if fine is None else fine.prepare()
        return None if point is None else point.at_patches

    # --- the work -------------------------------------------------------------------------------------

    def refine(self, budget: float) -> bool:
        """Work on what is made of the solution for about `budget` seconds; False if nothing needed any."""
        refining = self._fine is not None and self._fine.step(budget)
        gathering = self._gathers is not None and self._gathers.step(budget)
        return refining or gathering

    def trace(self, budget: float) -> bool:
        """As `refine`, on frames that go by the scene alone."""
        tolerance = self._settings.error_tolerance
        tracing = self._paths.step(budget, tolerance)
        if self._instant is not None:
            tracing = self._instant.step(budget, tolerance) or tracing
        return tracing

    # --- views ----------------------------------------------------------------------------------------

    def camera(self, choice: CameraChoice, samples: int = 1) -> Camera:
        """The camera that is meant. Raises SceneError naming the field, LimitExceededError."""
        camera = choice.resolve(self._world.scene)
        self._limits.check(camera, samples)
        return camera

    def view(self, request: FrameRequest, drags: bool) -> View:
        """What a request looks at; where an object `drags`, the solution is worked on while it is drawn.

        Raises NotAvailableError, SceneError, LimitExceededError, RenderingUnavailableError.
        """
        renderer = renderer_of(request)
        camera = self.camera(request.camera, request.samples)
        if renderer is RendererName.AUTO:
            names = renderers_for(request, self._solution)
            return AutoView(
                tuple((name, self.view(replace(request, renderer=name), drags)) for name in names)
            )
        if renderer is RendererName.PATH:
            return self._path_view(camera, request)
        self._drawing.require(renderer, request.layer)
        self._drawing.require_device()
        if renderer is RendererName.VPL:
            return self._instant_view(camera, request)
        if self._solution.is_sampled and renderer is RendererName.GATHER:
            raise NotAvailableError("in a scene too large to link, the renderer", renderer, WITHOUT_LINKS)
        fine = self.fine_light()
        shown = RendererName.GOURAUD if renderer is RendererName.GATHER else renderer
        solution, glance = self._solution, _MEANWHILE * camera.width * camera.height * request.samples
        view = SolutionView(
            solution, self._drawing, self._seen_errors, camera, shown, request.layer, request.samples,
            (lambda: solution.step(glance)) if drags and solution.state is SessionState.SOLVING else None,
        )  # fmt: skip
        if renderer is RendererName.GATHER:
            return self._gather_view(fine, view)
        if renderer is not RendererName.INTERPOLANT or self._solution.is_sampled:
            return view
        if fine is not None:
            fine.ask(camera)
        return InterpolantView(view, fine, self._followed)

    def _path_view(self, camera: Camera, request: FrameRequest) -> PathView:
        if request.layer is not LayerName.RADIANCE:
            raise NotAvailableError("layer of the path renderer", request.layer, (LayerName.RADIANCE,))
        asked = self._paths.ask(camera, request.samples, request.max_error)
        return PathView(asked, self._settings.error_tolerance)

    def _instant_view(self, camera: Camera, request: FrameRequest) -> InstantView:
        if self._instant is None:
            self._instant = InstantFrames(self._world, self._settings, self.known_light)
        asked = self._instant.ask(camera, request.samples, request.max_error, self._drawing)
        return InstantView(asked, self._world, request.layer, self._settings.error_tolerance)

    def _gather_view(self, fine: FineLight | None, coarse: SolutionView) -> GatherView:
        point = None if fine is None else fine.prepare()
        if point is None:
            return GatherView(coarse, None, fine)
        if self._gathers is None:
            self._gathers = GatherFrames(self._world, self._solution.field(), point, self._drawing)
        return GatherView(coarse, self._gathers.ask(coarse.camera, coarse.samples), fine)

    def build_everything(self) -> None:
        """Build the interpolants of all triangles, seen or not, once there are any."""
        if self._fine is not None and self._fine.interpolants is not None:
            self._fine.build(np.arange(len(self._fine.interpolants.triangulation.triangles), dtype=np.int32))


def renderer_of(request: FrameRequest) -> RendererName:
    """The renderer that is meant."""
    return request.renderer or BEST_RENDERER
