"""The best frame that can be had now, whichever renderer makes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from solver.engine.drawing import LIT_LAYERS
from solver.engine.instant.frames import MOST_SAMPLES
from solver.engine.requests import FrameRequest, LayerName, RendererName
from solver.engine.solution import Solution
from solver.engine.status import SessionState
from solver.engine.views import View
from solver.types import AnyArray

_QUICK: Final = 400
"""Patches that are solved over links before virtual lights would tell as much: their time is not shared."""


def renderers_for(request: FrameRequest, solution: Solution) -> tuple[RendererName, ...]:
    """Which renderers are worth working on for a frame, the one to be shown first where all are as good.

    Interpolants, wherever light is diffuse; virtual lights too while a large scene is being linked, since
    they need no links, and where no links are made at all. Where light is not diffuse, virtual lights and
    paths, the only ones that know.
    """
    surfaces = solution.world.surfaces
    instant = request.layer in LIT_LAYERS and request.samples <= MOST_SAMPLES
    if not (surfaces.has_specular or surfaces.has_directional_emission):
        large = surfaces.patch_count > _QUICK and solution.state is SessionState.SOLVING
        if instant and (large or solution.is_sampled):
            return RendererName.INTERPOLANT, RendererName.VPL
        return (RendererName.INTERPOLANT,)
    traced = request.layer is LayerName.RADIANCE
    if instant:
        return (RendererName.VPL, RendererName.PATH) if traced else (RendererName.VPL,)
    return (RendererName.PATH,) if traced else (RendererName.INTERPOLANT,)


@dataclass(frozen=True, eq=False)
class AutoView:
    """The view with the least estimated error of several."""

    views: tuple[tuple[RendererName, View], ...]

    @property
    def chosen(self) -> tuple[RendererName, View]:
        """What would be shown, and who draws it: the first of those that are within the tolerance, or the
        one with the least estimated error."""

        def rank(number: int) -> tuple[bool, bool, float]:
            view = self.views[number][1]
            return not view.drawable, not view.converged, 0.0 if view.converged else view.error_estimate

        return self.views[min(range(len(self.views)), key=rank)]

    @property
    def drawable(self) -> bool:
        """Whether any is."""
        return self.chosen[1].drawable

    @property
    def error_estimate(self) -> float:
        """That of the view that is shown."""
        return self.chosen[1].error_estimate

    @property
    def converged(self) -> bool:
        """Whether that view is."""
        return self.chosen[1].converged

    @property
    def improving(self) -> bool:
        """Whether any is."""
        return any(view.improving for _, view in self.views)

    @property
    def version(self) -> str:
        """Of the view that is shown."""
        name, view = self.chosen
        return f"{name}.{view.version}"

    def draw(self) -> AnyArray:
        """The picture of the view that is shown. Raises RenderingUnavailableError."""
        return self.chosen[1].draw()
