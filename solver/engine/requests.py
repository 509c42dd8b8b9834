"""What may be asked of an engine: a frame, and how long to wait for a better one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from solver.document.conversion import DEFAULT_CAMERA, is_parallel, up_of
from solver.errors import LimitExceededError, SolverError, UnknownCameraError
from solver.geometry.scene import Camera, Scene
from solver.rendering.encoding import LinearFormat, PictureFormat
from solver.rendering.tone_mapping import ToneCurve


class NotAvailableError(SolverError):
    """Something that the interface names, and that this version cannot do yet."""

    def __init__(self, what: str, name: str, available: tuple[str, ...]) -> None:
        self.what = what
        self.name = name
        self.available = available
        super().__init__(f"{what} {name!r} is not available yet; there are {', '.join(available)}")


class RendererName(StrEnum):
    """How a frame is made."""

    FLAT = "flat"
    """One radiance an element"""
    GOURAUD = "gouraud"
    """Radiance interpolated between the corners of elements"""
    INTERPOLANT = "interpolant"
    VPL = "vpl"
    """By virtual point lights: instant radiosity, straight from the scene"""
    GATHER = "gather"
    PATH = "path"
    """The path-traced check"""
    AUTO = "auto"
    """Whichever of them has the least estimated error by then"""


class LayerName(StrEnum):
    """What a frame shows."""

    RADIANCE = "radiance"
    IRRADIANCE = "irradiance"
    ILLUMINANCE = "illuminance"
    DEPTH = "depth"
    POSITION = "position"
    NORMAL = "normal"
    OBJECT = "object"
    ELEMENT = "element"
    TRIANGLE = "triangle"
    BARYCENTRIC = "barycentric"
    ERROR = "error"
    FALSE_COLOUR = "false_colour"


@dataclass(frozen=True)
class CameraChoice:
    """A camera of the scene, with what is given here in place of its own."""

    name: str | None = None
    """None: the camera `main`, or the scene's first."""
    eye: tuple[float, float, float] | None = None
    target: tuple[float, float, float] | None = None
    up: tuple[float, float, float] | None = None
    vertical_fov: float | None = None
    width: int | None = None
    height: int | None = None

    def resolve(self, scene: Scene) -> Camera:
        """The camera. Raises UnknownCameraError, or SceneError where it has no direction to look in."""
        name = self.name
        if name is None:
            first = next(iter(scene.cameras), DEFAULT_CAMERA)
            name = DEFAULT_CAMERA if DEFAULT_CAMERA in scene.cameras else first
        base = scene.cameras.get(name)
        if base is None:
            raise UnknownCameraError(name, tuple(scene.cameras))
        eye = base.eye if self.eye is None else np.array(self.eye)
        target = base.target if self.target is None else np.array(self.target)
        up = self.up
        if up is None and not is_parallel(target - eye, base.up):
            up = tuple(base.up)
        return Camera(
            eye=eye,
            target=target,
            up=up_of(eye, target, up),
            vertical_fov=base.vertical_fov if self.vertical_fov is None else self.vertical_fov,
            width=base.width if self.width is None else self.width,
            height=base.height if self.height is None else self.height,
        )


@dataclass(frozen=True)
class FrameRequest:
    """A frame."""

    camera: CameraChoice = CameraChoice()
    renderer: RendererName | None = None
    """None: the best there is."""
    layer: LayerName = LayerName.RADIANCE
    samples: int = 1
    """Samples of a pixel, for antialiasing."""
    max_error: float = math.inf
    """A path-traced frame is worked on until its error is at most this, and within the tolerance."""


@dataclass(frozen=True)
class FrameLimits:
    """The largest frame that is drawn."""

    max_width: int = 16_384
    max_height: int = 16_384
    max_pixels: int = 2**26
    max_samples: int = 4096
    """Samples of a pixel"""

    def check(self, camera: Camera, samples: int) -> None:
        """Raise LimitExceededError where a frame of `camera` is larger."""
        for what, value, limit in (
            ("width", camera.width, self.max_width),
            ("height", camera.height, self.max_height),
            ("pixels", camera.width * camera.height, self.max_pixels),
            ("samples", samples, self.max_samples),
        ):
            if value > limit:
                raise LimitExceededError(what, value, limit)


@dataclass(frozen=True)
class Encoding:
    """How a frame is turned into a file."""

    format: PictureFormat | LinearFormat = PictureFormat.PNG
    exposure: float | None = None
    """Stops; None: so that the picture is neither dark nor pale. Only pictures of radiance heed it."""
    tone_map: ToneCurve = ToneCurve.LINEAR
    """Only pictures of radiance heed it."""


class WaitFor(StrEnum):
    """When a frame is good enough to be sent."""

    NONE = "none"
    """At once"""
    CONVERGED = "converged"
    """When it is within the tolerance of the settings"""
    MAX_ERROR = "max_error"
    """When its error estimate is at most a given number"""


@dataclass(frozen=True)
class Wait:
    """What to wait for before a frame is sent."""

    until: WaitFor = WaitFor.NONE
    max_error: float = 0.0

    def is_over(self, error_estimate: float, converged: bool) -> bool:
        """Whether a frame of that error need not be waited for any longer."""
        match self.until:
            case WaitFor.NONE:
                return True
            case WaitFor.CONVERGED:
                return converged
            case WaitFor.MAX_ERROR:
                return error_estimate <= self.max_error
