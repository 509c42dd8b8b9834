"""What a frame request looks at: the radiosity solution, or a path-traced frame.

A view tells how good a frame of it would be now, whether that can still get better, and draws it. The
choice between the two is made once, when the request is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from solver.engine.drawing import LIT_LAYERS, Drawing
from solver.engine.fine import FineLight
from solver.engine.followed import FollowedLight
from solver.engine.gathers import GatherFrame
from solver.engine.instant.frames import AskedInstant
from solver.engine.paths import AskedFrame
from solver.engine.requests import LayerName, RendererName, Wait
from solver.engine.seen import SeenErrors, SeenLight
from solver.engine.solution import Solution
from solver.engine.status import SessionState
from solver.engine.world import World
from solver.geometry.scene import Camera
from solver.rendering.false_colour import false_colour
from solver.rendering.renderer import Meanwhile
from solver.types import LUMINANCE_WEIGHTS, AnyArray


@dataclass(frozen=True)
class Outlook:
    """What a frame would be if it were drawn now."""

    tag: str
    """Frames of one request and one tag are the same"""
    renderer: RendererName
    revision: int
    error_estimate: float
    """Estimated relative error of the light in it"""
    converged: bool
    """Whether that is within the tolerance of the settings"""
    drawable: bool
    """Whether there is anything to draw yet"""
    improving: bool
    """Whether it would be better if it were drawn later"""

    def is_worth(self, wait: Wait) -> bool:
        """Whether the frame can be drawn, and is as good as `wait` asks or as it will ever be."""
        good = wait.is_over(self.error_estimate, self.converged) or not self.improving
        return self.drawable and good


@dataclass(frozen=True, eq=False)
class Frame:
    """A picture, not yet encoded."""

    image: AnyArray
    """(height, width, ...), top row first; what a pixel holds is the layer's."""
    outlook: Outlook
    seconds: float
    """Until it was drawn, with what was done meanwhile"""


class View(Protocol):
    """What a frame is drawn from."""

    @property
    def drawable(self) -> bool:
        """Whether there is anything to draw yet."""

    @property
    def error_estimate(self) -> float:
        """Estimated relative error of a frame drawn now."""

    @property
    def converged(self) -> bool:
        """Whether that is within the tolerance of the settings."""

    @property
    def improving(self) -> bool:
        """Whether a frame drawn later will be better."""

    @property
    def version(self) -> str:
        """Frames of one version are the same."""

    def draw(self) -> AnyArray:
        """The picture, (height, width, ...)."""


@dataclass(frozen=True, eq=False)
class SolutionView:
    """The radiosity solution seen by a camera."""

    solution: Solution
    drawing: Drawing
    seen: SeenErrors
    camera: Camera
    renderer: RendererName
    layer: LayerName
    samples: int
    meanwhile: Meanwhile | None = None
    """What is done while a frame of it is drawn"""

    @property
    def drawable(self) -> bool:
        """The field can be drawn from the first moment on."""
        return True

    @property
    def error_estimate(self) -> float:
        """Estimated relative error of the elements that the camera sees, shown as they are."""
        return self.light().of_elements(self.solution.error_estimate)

    def light(self) -> SeenLight:
        """How the light that the camera sees differs from that of all surfaces."""
        return self.seen.light(self.camera, self.solution)

    @property
    def converged(self) -> bool:
        """Whether the solution is."""
        return self.solution.state is SessionState.CONVERGED

    @property
    def improving(self) -> bool:
        """Whether the solution is worked on."""
        return self.solution.state is SessionState.SOLVING

    @property
    def version(self) -> str:
        """The version of the field."""
        return str(self.solution.version)

    def draw(self) -> AnyArray:
        """The picture. Raises RenderingUnavailableError."""
        world = self.solution.world
        return self.drawing.draw(
            world, self.solution.field(), self.camera, self.renderer, self.layer, self.samples,
            self.meanwhile,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class InterpolantView:
    """The interpolants of a solution at rest seen by a camera; before, earlier ones that follow it."""

    coarse: SolutionView
    fine: FineLight | None
    """None while the solution is worked on"""
    followed: FollowedLight | None = None
    """What is shown until there are interpolants, if there were some before an edit"""

    @property
    def drawable(self) -> bool:
        """The field can be drawn from the first moment on."""
        return True

    @property
    def error_estimate(self) -> float:
        """Estimated relative error of what the camera sees."""
        fine = self.fine
        added = None if fine is None else fine.interpolation_error(self.coarse.camera)
        if fine is None or added is None:
            return self.coarse.error_estimate
        return min(1.0, math.hypot(self.coarse.light().of_field(fine.gather_error), added))

    @property
    def converged(self) -> bool:
        """Whether the solution is, and all that is in view is built."""
        return self.fine is not None and self.coarse.converged and self.fine.is_complete(self.coarse.camera)

    @property
    def improving(self) -> bool:
        """Whether there is work to do."""
        if self.fine is None:
            return self.coarse.improving
        return self.fine.failure is None and not self.fine.is_complete(self.coarse.camera)

    @property
    def version(self) -> str:
        """Of the field and of what is built on it."""
        return f"{self.coarse.version}.{0 if self.fine is None else self.fine.version}"

    def draw(self) -> AnyArray:
        """The picture. Raises RenderingUnavailableError."""
        c, meanwhile = self.coarse, None
        mesh = None if self.fine is None else self.fine.mesh()
        if mesh is None and self.followed is not None and c.layer in LIT_LAYERS:
            mesh, meanwhile = self.followed.mesh(c.solution, c.drawing), c.meanwhile
        if mesh is None:
            return c.draw()
        return c.drawing.draw_mesh(
            c.solution.world, mesh, c.camera, c.renderer, c.layer, c.samples, meanwhile
        )


@dataclass(frozen=True, eq=False)
class GatherView:
    """A frame gathered pixel by pixel from a solution at rest."""

    coarse: SolutionView
    """What is shown where time is up before there is anything else"""
    frame: GatherFrame | None
    """None while the solution is worked on"""
    fine: FineLight | None

    @property
    def drawable(self) -> bool:
        """Whether every pixel has its light."""
        return self.frame is not None and self.frame.is_complete

    @property
    def error_estimate(self) -> float:
        """Estimated relative error of the light in it."""
        if self.fine is None or not self.drawable:
            return self.coarse.error_estimate
        return self.coarse.light().of_field(self.fine.gather_error)

    @property
    def converged(self) -> bool:
        """Whether the solution is, and the frame is complete."""
        return self.coarse.converged and self.drawable

    @property
    def improving(self) -> bool:
        """Until it is complete."""
        failed = self.fine is not None and self.fine.failure is not None
        return not self.drawable and not failed and self.coarse.solution.state is not SessionState.FAILED

    @property
    def version(self) -> str:
        """Of the field, and the pixels done."""
        return f"{self.coarse.version}.{0 if self.frame is None else self.frame.done}"

    def draw(self) -> AnyArray:
        """The picture, (h, w, 3), or (h, w) lux. Raises RenderingUnavailableError."""
        if self.frame is None:
            return self.coarse.draw()
        image = self.frame.image(self.coarse.layer)
        if self.coarse.layer is LayerName.ILLUMINANCE:
            efficacy = self.coarse.solution.world.scene.luminous_efficacy
            return efficacy * (image @ LUMINANCE_WEIGHTS.astype(np.float32))
        return image


@dataclass(frozen=True, eq=False)
class PathView:
    """A path-traced frame in the making."""

    asked: AskedFrame
    tolerance: float

    @property
    def drawable(self) -> bool:
        """Whether every pixel has its samples."""
        return self.asked.frame.samples >= self.asked.samples

    @property
    def error_estimate(self) -> float:
        """Relative RMS error of the frame that its own spread tells; 1 until it can."""
        return min(1.0, self.asked.error_estimate)

    @property
    def converged(self) -> bool:
        """Whether the noise is within the tolerance."""
        return self.asked.error_estimate <= self.tolerance

    @property
    def improving(self) -> bool:
        """More paths always help, until the frame is as good as asked."""
        return not self.asked.is_done(self.tolerance)

    @property
    def version(self) -> str:
        """Rays in the mean."""
        return str(self.asked.frame.ray_count)

    def draw(self) -> AnyArray:
        """Radiance, (height, width, 3) W/(m2 sr)."""
        return self.asked.frame.radiance


@dataclass(frozen=True, eq=False)
class InstantView:
    """A frame by virtual lights in the making."""

    asked: AskedInstant
    world: World
    layer: LayerName
    tolerance: float

    @property
    def drawable(self) -> bool:
        """Once there is light of the scene as it stands."""
        return self.asked.frame.is_drawable

    @property
    def error_estimate(self) -> float:
        """Relative RMS error of reflected light that blocks of lights tell of each other."""
        return self.asked.frame.error_estimate

    @property
    def converged(self) -> bool:
        """Whether that is within the tolerance."""
        return self.asked.frame.is_new and self.asked.frame.error_estimate <= self.tolerance

    @property
    def improving(self) -> bool:
        """More lights always help, until the frame is as good as asked."""
        return not self.asked.is_done(self.tolerance)

    @property
    def version(self) -> str:
        """Of the picture."""
        return str(self.asked.frame.version)

    def draw(self) -> AnyArray:
        """Radiance or irradiance (h, w, 3), illuminance (h, w) lux, or what stands for it in colours."""
        frame = self.asked.frame
        if self.layer is LayerName.RADIANCE:
            return frame.radiance().astype(np.float32)
        irradiance = frame.irradiance().astype(np.float32)
        if self.layer is LayerName.IRRADIANCE:
            return irradiance
        illuminance = irradiance @ LUMINANCE_WEIGHTS.astype(np.float32)
        if self.layer is LayerName.FALSE_COLOUR:
            return false_colour(illuminance)
        return self.world.scene.luminous_efficacy * illuminance
